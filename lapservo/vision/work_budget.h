#pragma once

#include <algorithm>
#include <limits>
#include <optional>

namespace lapservo::internal {

/// What looking at a frame may cost, in units of work. They are counted by what is done (SearchCosts says how many
/// units a step has), not by a clock: the same frames give the same results whatever else the machine does.
class WorkBudget {
 public:
  /// nullopt: without a bound.
  explicit WorkBudget(std::optional<double> units) : left_(units.value_or(std::numeric_limits<double>::infinity())) {}

  void spend(double units) { left_ -= units; }

  /// Whether enough is left for a step of so many units. A search's first step is always allowed, else one might never
  /// get anywhere.
  bool allows(double units) {
    const bool enough = !stepped_ || left_ >= units;
    stepped_ = true;
    return enough;
  }

  /// Lets `work` spend from this budget, but at most a fraction of what is left; returns what it returns.
  template <class Work>
  auto share(double fraction, Work&& work) {
    WorkBudget part(std::max(0.0, fraction * left_));
    const double before = part.left_;
    auto result = work(part);
    if (before < std::numeric_limits<double>::infinity()) spend(before - part.left_);
    return result;
  }

 private:
  double left_;
  bool stepped_ = false;
};

}  // namespace lapservo::internal
