#pragma once

#include <array>
#include <cstdint>

#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/print_sides.h"

namespace lapservo::internal {

/// The evidence of a run's frames about a print.
struct PrintRecordLimits {
  double wholly_located = 0.8, most_p_false = 1e-4;  ///< the rig's: all boundaries on such a part, psi so rarely wrong
  /// From one side that is so near, and two that show much of the same (a camera sees 1 rad to either side).
  double near_rad = 0.6, in_view_rad = 1.2;
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
