#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

namespace lapservo::internal {

/// What looking at a frame may cost, in units of work. They are counted by what is done (SearchCosts says how many
/// units a step has), not by a clock: the same frames give the same results whatever else the machine does.
class WorkBudget {
 public:
  /// nullopt: without a bound.
  explicit WorkBudget(std::optional<double> units) : left_(units.value_or(std::numeric_limits<double>::infinity())) {}

  double left() const { return left_; }
  void spend(double units) { left_ -= units; }

  /// Whether enough is left for a step of so many units, or this is the one that is allowed whatever is left.
  bool allows(double units) { return left_ >= units || std::exchange(free_step_, false); }

  /// One step is allowed whatever is left: without, a search that gets too little would never get anywhere.
  void set_free_step(bool free_step) { free_step_ = free_step; }

  /// Lets `work` spend from this budget, at most so many units; returns what it returns.
  template <class Work>
  auto share(double units, bool free_step, Work&& work) {
    WorkBudget part(std::clamp(units, 0.0, std::max(0.0, left_)));
    part.free_step_ = free_step;
    const double before = part.left_;
    auto result = work(part);
    if (before < std::numeric_limits<double>::infinity()) spend(before - part.left_);
    return result;
  }

 private:
  double left_;
  bool free_step_ = false;
};

}  // namespace lapservo::internal
