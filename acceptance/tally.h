#pragma once

#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "acceptance/frame_sets.h"
#include "lapservo/core/angles.h"

namespace lapservo::acceptance {

/// Results of images of markers that differ from the rig: statuses, and psi's errors where it is `ok`.
struct Tally {
  int frames = 0, wrong = 0;  ///< wrong: psi off by more than 0.1 rad
  std::map<std::string, int> statuses;
  std::vector<double> errors_rad, errors_sigmas;

  /// The seam's error is invisible.
  void add(const Observation& o, double true_psi_rad, double seam_error_rad) {
    ++frames;
    ++statuses[std::string(to_string(o.status))];
    if (o.status != Status::ok || !o.rcm) return;
    const double error_rad = internal::wrap_pi(o.rcm->q.psi_rad - true_psi_rad - seam_error_rad);
    wrong += std::abs(error_rad) > 0.1;
    errors_rad.push_back(error_rad);
    errors_sigmas.push_back(error_rad / std::sqrt(o.rcm->covariance(3, 3)));
  }
  void add(const Tally& other) {
    frames += other.frames, wrong += other.wrong;
    for (const auto& [status, count] : other.statuses) statuses[status] += count;
    errors_rad.insert(errors_rad.end(), other.errors_rad.begin(), other.errors_rad.end());
    errors_sigmas.insert(errors_sigmas.end(), other.errors_sigmas.begin(), other.errors_sigmas.end());
  }
  double fraction(const std::string& status) const {
    const auto found = statuses.find(status);
    return found == statuses.end() ? 0 : static_cast<double>(found->second) / frames;
  }
  void show(const std::string& name) const {
    std::printf("%s: %d frames", name.c_str(), frames);
    for (const auto& [status, count] : statuses) std::printf(", %d %s", count, status.c_str());
    std::printf("; psi rms %.2f mrad, largest %.1f mrad, error / sigma %.2f, %d wrong\n", 1e3 * rms(errors_rad),
                1e3 * largest(errors_rad), rms(errors_sigmas), wrong);
    std::fflush(stdout);
  }
};

}  // namespace lapservo::acceptance
