#pragma once

#include <array>

#include "lapservo/geometry/camera.h"
#include "lapservo/vision/edges/edge_measurements.h"

namespace lapservo::internal {

/// How far one sigma of each number of the rig's camera moves measurements [px], to first order. Numbers count as
/// independent of one another, but for the two focal lengths, a third of whose variance is common: a camera's mostly
/// have all of it in common, but the rig does not say.
class RigErrors {
 public:
  static constexpr int most = 11;
  using Shifts = Eigen::Matrix<double, most, 1>;

  RigErrors() = default;
  /// `by_exponent_px`: how far a boundary moves with the exponent of the camera's response (moved_by_exponent_px()).
  RigErrors(const Camera& camera, const std::array<double, 4>& by_exponent_px);

  bool any() const { return camera_ != nullptr; }
  /// Zero for numbers without a sigma.
  Shifts of(const Measurement& measurement) const;

 private:
  const Camera* camera_ = nullptr;
  std::array<double, 4> response_px_{};
};

/// Whether the camera has sigmas that move measurements.
bool has_sigmas(const Camera& camera);

}  // namespace lapservo::internal
