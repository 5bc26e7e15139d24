#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// When frames were taken, by a clock that always goes on.
class FrameClock {
 public:
  /// A power of two, so that equal steps are equal in doubles.
  static constexpr int frames_a_second = 32;
  static constexpr double usual_period_s = 1.0 / frames_a_second;

  /// The next frame's time. Goes on by usual_period_s where its time is not known, or does not go on from the time
  /// before.
  double next(std::optional<double> time_s) {
    const double since_s = time_s && last_s_ ? *time_s - *last_s_ : 0;
    now_s_ += since_s > 0 && std::isfinite(since_s) ? since_s : usual_period_s;
    last_s_ = time_s;
    return now_s_;
  }

 private:
  double now_s_ = 0;
  std::optional<double> last_s_;
};

/// In which of a followed marker's frames to look at what the camera did to the image (picture_processing.h). A camera
/// that processes its images is looked at in each frame, since what to take off depends on the frame. One that does not
/// is looked at now and then, and where the blur changes (Expected). A full look that stays without an answer costs
/// several times a tracked frame, and the next frame rarely differs: it is repeated after 1, 2, 4, ... frames.
class LookSchedule {
 public:
  bool is_due() const { return frames_left_ == 0; }

  /// `fully`: the look took more than a first guess.
  void looked(Processing answer, bool fully) {
    const bool in_vain = answer == Processing::unknown && fully;
    frames_left_ = answer == Processing::none ? after_none : in_vain ? pause_ : 0;
    if (in_vain) pause_ = std::min(2 * pause_, longest_pause);
    if (answer != Processing::unknown) pause_ = 1;
  }
  void passed() { frames_left_ = std::max(0, frames_left_ - 1); }

 private:
  static constexpr int after_none = 15, longest_pause = 2 * FrameClock::frames_a_second;
  int frames_left_ = 0, pause_ = 1;
};

/// The memory of an instrument that was found in the frame before. Times are FrameClock's.
struct InstrumentMemory {
  double time_s;
  FineFit fit;
  LookSchedule looks;
  PoseVector step = PoseVector::Zero();  ///< of the unknowns, from the frame before
  double step_s = 0;                     ///< which took so long; 0 where none was found before

  Expected expected(double at_s) const;
  /// Where it is when it moves on as it did, for some steps at most.
  PoseUnknowns expected_pose(double at_s) const;
};

/// After a frame in which it was found.
InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, double time_s);

/// The evidence of a run's frames about a print.
struct PrintRecordLimits {
  /// The rig's: all boundaries on such a part, psi wrong no oftener than print_limits.fraction_of_known.
  double wholly_located = 0.8;
  /// From one so many sides away at most, and two that show much of the same (a camera sees four to either side).
  std::size_t near_sides = 2, in_view_sides = 5;
  double exchange_s = 2;                        ///< of which nothing was added for so long may be another instrument's
  int least_off_sides = 3, off_for_others = 2;  ///< and so many times those from which it may be the rig's
};
inline constexpr PrintRecordLimits print_record_limits;

/// Whether a frame showed that the print is the rig's, as far as psi goes: wholly seen, and hardly ever wrong.
bool shows_the_rigs_print(const FineFit& fit);

/// The evidence of a run's frames about one instrument's print, from each side. A misprint looks like the rig's, but
/// turned, from few sides; and where blood hides an inner boundary a single frame can't show it.
class PrintRecord {
 public:
  /// `possible`: nothing speaks against the rig's print, but the frame could not show it.
  enum class View : std::uint8_t { unseen, possible, the_rigs, off };

  /// Before each frame; times are FrameClock's. Forgets a print of which nothing was added for so long that it may be
  /// another one.
  void begin_frame(double time_s);
  /// The latest from there counts, but what is possible is no news of what was the rig's. `tau_rad`: of the generatrix
  /// that faces the camera, any angle.
  void add(double tau_rad, View view);
  /// From which what shows was seen from two sides to be the rig's, and from none to be off.
  PrintSides known_sides() const;
  /// Whether it is off from several sides, and from far more than it may be the rig's.
  bool is_off() const;

 private:
  std::array<View, print_sides> views_{};
  double now_s_ = 0, seen_s_ = 0;
};

}  // namespace lapservo::internal
