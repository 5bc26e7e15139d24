#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// Detects in images alone that the endoscope moved: shafts that passed the RCM miss it from some frame on, those of
/// all visible instruments. It can't detect a rotation about the RCM, or a motion that looks like one of the
/// instrument.
class RegistrationWatch {
 public:
  /// The observations of one frame. How many frames ago a shaft missed the RCM first, those without it counted, where
  /// the endoscope has moved; said once.
  std::optional<int> add(const std::vector<Observation>& observations) {
    for (const Observation& observation : observations) add(observation);
    std::optional<int> first;
    for (const auto& [name, seen] : seen_) {
      if (!seen.silent()) return std::nullopt;
      if (seen.misses()) first = std::max(first.value_or(0), seen.since_first);
    }
    if (first) seen_.clear();
    return first;
  }

 private:
  static constexpr int frames = 5;  // informative ones
  struct Seen {
    int passing = 0, missing = 0, absent = 0;  // frames in a row
    int since_first = 0;                       // frames since the first of those that miss
    bool agreed = false;
    bool misses() const { return agreed && missing >= frames; }
    bool silent() const { return !agreed || missing >= frames || absent >= frames; }
  };
  void add(const Observation& observation) {
    Seen& seen = seen_[observation.instrument];
    const bool ok = observation.status == Status::ok, passes = ok && observation.rcm;
    seen.absent = ok ? 0 : seen.absent + 1;
    seen.since_first = seen.missing > 0 ? seen.since_first + 1 : 0;
    if (!ok) return;
    seen.passing = passes ? seen.passing + 1 : 0;
    seen.missing = passes ? 0 : seen.missing + 1;
    seen.agreed = seen.agreed || seen.passing >= 2 * frames;
  }

  std::map<std::string, Seen> seen_;
};

}  // namespace lapservo::internal
