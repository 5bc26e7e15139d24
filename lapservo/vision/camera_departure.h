#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include "lapservo/geometry/camera.h"
#include "lapservo/vision/light_image.h"
#include "lapservo/vision/pooled_edges.h"

namespace lapservo::internal {

/// What a camera does to its pictures that the rig's camera does not say, as frames show it. Of a magnification that
/// may be there or not there is only the sigma.
struct CameraDeparture {
  ChromaticAberration aberration = {}, sigma_aberration{0, 0};  ///< times the rig's
  double exponent = 1, sigma_exponent = 0;                      ///< light is the rig's to this power
  /// What is left of it moves each boundary by, one sigma: of the aberration by each pixel that the boundary lies from
  /// the principal point along its normal; and of the response [px].
  std::array<double, 4> doubt_of_radial{}, doubt_of_response_px{};

  /// Whether any of it is in doubt.
  bool doubted() const { return sigma_exponent != 0 || sigma_aberration != ChromaticAberration{0, 0}; }
  bool any() const { return exponent != 1 || aberration != ChromaticAberration{}; }
  /// Whether edges are seen at the same places through both.
  bool moves_alike(const CameraDeparture& other) const {
    return exponent == other.exponent && aberration == other.aberration;
  }
  double doubt_px(std::size_t boundary, double radial_px) const {
    return std::hypot(doubt_of_radial[boundary] * radial_px, doubt_of_response_px[boundary]);
  }
  /// Both, where `more` is what a frame that was seen through this one shows. Nullopt beyond what cameras have.
  std::optional<CameraDeparture> then(const CameraDeparture& more) const;
};

/// A frame's light as a camera that departs from the rig's shows it.
class DepartedLight {
 public:
  DepartedLight(const LightImage& light, const CameraDeparture& departure);
  DepartedLight(const DepartedLight&) = delete;
  DepartedLight& operator=(const DepartedLight&) = delete;
  const LightImage& light() const { return light_; }

 private:
  std::array<float, 256> light_of_value_;  // where it is not the rig's
  LightImage light_;
};

/// What is there beyond what `light` undoes already: of lateral chromatic aberration and a response that is not the
/// rig's, the one that explains where the three channels show the boundaries; nullopt where nothing needs explaining.
/// `glance` is what glance_at() makes of
/// `light` and `measurements`, `blur_px` what fit_step was told. Of pictures that were processed (picture_processing.h)
/// it may say anything.
std::optional<CameraDeparture> find_departure(const LightImage& light, std::span<const Measurement> measurements,
                                              const PooledEdges& glance, double blur_px);

}  // namespace lapservo::internal
