#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// Detects in images alone that the endoscope moved: shafts that passed the RCM miss it from some frame on, those of
/// all visible instruments. It can't detect a rotation about the RCM, or a motion that looks like one of the
/// instrument.
class RegistrationWatch {
 public:
  /// The observations of one frame. True: the endoscope moved some frames ago; said once.
  bool add(const std::vector<Observation>& observations) {
    for (const Observation& observation : observations) add(observation);
    const bool moved = std::any_of(seen_.begin(), seen_.end(), [](const auto& s) { return s.second.misses(); }) &&
                       std::all_of(seen_.begin(), seen_.end(), [](const auto& s) { return s.second.silent(); });
    if (moved) seen_.clear();
    return moved;
  }
  static constexpr int frames = 5;  ///< informative frames

 private:
  struct Seen {
    int passing = 0, missing = 0, absent = 0;  // frames in a row
    bool agreed = false;
    bool misses() const { return agreed && missing >= frames; }
    bool silent() const { return !agreed || missing >= frames || absent >= frames; }
  };
  void add(const Observation& observation) {
    Seen& seen = seen_[observation.instrument];
    const bool ok = observation.status == Status::ok, passes = ok && observation.rcm;
    seen.absent = ok ? 0 : seen.absent + 1;
    if (!ok) return;
    seen.passing = passes ? seen.passing + 1 : 0;
    seen.missing = passes ? 0 : seen.missing + 1;
    seen.agreed = seen.agreed || seen.passing >= 2 * frames;
  }

  std::map<std::string, Seen> seen_;
};

}  // namespace lapservo::internal
