#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

namespace lapservo::internal {

/// The budget of a frame, in units of work. Units are counted by what is done (SearchCosts says how many units a step
/// has), not by a clock: the same frames give the same results whatever else the machine does.
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

/// Costs of the steps of a search, in units of work. A unit is 0.44 us of a core that copies a frame of 1920x1080 in
/// 0.125 ms. Measured in the sequences of bench/hard_frames at that size, each step the least of four replays: of what
/// a frame has few of, the 90th percentile; of what it has hundreds of, the mean of the frames with most of them. A
/// step's cost is spent; what must be left for it to begin is what most take.
struct SearchCosts {
  double coarse_fit = 320, no_coarse_fit = coarse_fit / 2;  ///< that found the shaft; that did not, in its first round
  double fine_pass = 180, fine_end = 160;  ///< of a fine fit; when it converged, the print and its validation
  double processing = 2400;                ///< where the first guess at a camera's processing is not enough
  double departure = 150;                  ///< whether the camera departs from the rig's
  double no_starts = 15;                   ///< of one blob that has none
  double starts = 330;                     ///< of one that has, through the RCM; beside others lines are split twice
  double free_starts = 500;                ///< the same without the RCM
  double agreement = 12;                   ///< of one pose with the frame's colours
  double blobs_per_px = 2.2e-4;
  double part_beside = 0.5;  ///< of the budget where every sample is tested for another instrument that hides it
  double fine_fit() const { return 3 * fine_pass + fine_end; }
  double try_start() const { return coarse_fit + fine_fit(); }
  double fit_to_result() const { return 150 * agreement + fine_fit(); }
};
inline constexpr SearchCosts search_costs;

}  // namespace lapservo::internal
