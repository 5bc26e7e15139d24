#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/vision/model/fine_fit.h"

namespace lapservo::internal {

/// What frames of a run tell of a print.
struct PrintRecordLimits {
  /// The rig's: all boundaries on nearly all lines, and at most these of PrintFit::far_off_probability and inner_off_m,
  /// of which exact prints have 1e-5 and 10 um in usual pictures.
  double wholly_located = 0.8, most_far_off = 0.005, most_inner_off_m = 0.03e-3;
  /// From one side that is so near, and two that show much of the same (a camera sees 1 rad to either side).
  double near_rad = 0.6, in_view_rad = 1.2;
  double exchange_s = 2;  ///< out of sight for so long it may have been exchanged for another instrument
  int least_off_sides = 3, off_for_others = 2;  ///< and so many times those from which it may be the rig's
};
inline constexpr PrintRecordLimits print_record_limits;

/// Whether a frame showed that the print is the rig's: wholly seen, its inner boundaries in their places and no print
/// that is far off as likely.
bool shows_the_rigs_print(const FineFit& fit);

/// What a run's frames showed of one instrument's print, from each side. A print that is off looks like the rig's, but
/// turned, from few sides; and where blood hides an inner boundary a single frame can't tell.
class PrintRecord {
 public:
  /// `possible`: nothing speaks against the rig's print, but the picture could not tell.
  enum class View : std::uint8_t { unseen, possible, the_rigs, off };

  /// Before each frame; times are FrameClock's. Forgets a print of which nothing was added for so long that it may be
  /// another one.
  void begin_frame(double time_s);
  /// The latest from there counts, but what is possible is no news of what was the rig's. `tau_rad`: of the generatrix
  /// that faces the camera, any angle.
  void add(double tau_rad, View view);
  /// Whether what shows from there was seen from two sides to be the rig's, and from none to be off.
  bool is_the_rigs(double tau_rad) const;
  /// Whether it is off from several sides, and from far more than it may be the rig's.
  bool is_off() const;

 private:
  static constexpr std::size_t sides = 24;
  std::array<View, sides> views_{};
  double now_s_ = 0, seen_s_ = 0;
};

}  // namespace lapservo::internal
