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

  /// Whatever is left: no step, the first (without, a search that gets too little would never get anywhere), or all,
  /// where what is begun must end in this frame.
  enum class Beyond { none, first, all };
  void allow(Beyond steps) { beyond_ = steps; }
  Beyond allowed() const { return beyond_; }

  /// Whether enough is left for a step of so many units, or it is allowed whatever is left.
  bool allows(double units) {
    if (beyond_ == Beyond::all) return true;
    return std::exchange(beyond_, Beyond::none) == Beyond::first || left_ >= units;
  }

  /// Lets `work` spend from this budget, at most so many units; returns what it returns.
  template <class Work>
  auto share(double units, Beyond beyond, Work&& work) {
    WorkBudget part(std::clamp(units, 0.0, std::max(0.0, left_)));
    part.allow(beyond);
    const double before = part.left_;
    auto result = work(part);
    if (before < std::numeric_limits<double>::infinity()) spend(before - part.left_);
    return result;
  }

 private:
  double left_;
  Beyond beyond_ = Beyond::none;
};

}  // namespace lapservo::internal
