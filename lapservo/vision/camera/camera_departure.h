#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include "lapservo/geometry/camera.h"
#include "lapservo/vision/camera/pooled_edges.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// When a camera counts as another than the rig's.
struct DepartureLimits {
  int reach_px = 4;  ///< across a boundary
  /// One sigma of where a channel shows a boundary, by its share of the largest change of light: shading and ink move
  /// weak channels, which are left out below a tenth.
  double sigma_px = 0.02, least_step = 0.1;
  double farthest_px = 1;  ///< what is farther from the others is no boundary
  /// Magnifications of lenses, beside 1; exponents of responses, too, and by how much the latter are tried.
  double usual_aberration = 2e-3, usual_exponent = 0.3, exponent_step = -0.1;
  /// Beyond any camera: the border's red and blue 10 px apart, light to the power of 0.5.
  double most_aberration = 0.01, most_exponent = 0.5;
  int least_degrees = 4;
  /// Squared sigmas: of all by which channels disagree, and left a degree where that is explained: at least, as what
  /// two degrees leave may be less by chance; and of a response at most, or it is specular light.
  double least_squares = 2.5, least_scatter = 0.2, most_response_scatter = 0.8;
  /// The gain of one number, by the scatter; and of a response, which must be another besides. Magnifications of clean
  /// images with highlights gain up to 6.3, of a steep marker with crosstalk 9.6; real ones mostly 15 and more.
  double least_gain = 11, least_response_gain = 5.5, least_exponent = 0.06;
  /// From where on a magnification may be there: highlights gain as much, but leave 0.6 and more (a swing of 72 frames;
  /// magnifications that were not accepted 0.1 to 0.25).
  double least_doubted_gain = 4, most_doubted_scatter = 0.4;
  double least_of_others = 0.5;  ///< of an exponent, measured without any one of the boundaries
  /// A departure's sigma takes in a part of what is left, most of which is common to all frames (exponents of 53 frames
  /// had a standard deviation of 0.008, for 0.028 by all of it), and of a response a part of itself: it is no power.
  double told_of_scatter = 0.5, told_of_response_scatter = 0.2, doubted_of_response = 0.03;
};
inline constexpr DepartureLimits departure_limits;

/// Effects that the rig's camera does not have, as frames show them. A magnification that may be there is only a sigma.
struct CameraDeparture {
  ChromaticAberration aberration = {}, sigma_aberration{0, 0};  ///< times the rig's
  double exponent = 1, sigma_exponent = 0;                      ///< light is the rig's to this power
  /// What is left of it moves each boundary by, one sigma: of the aberration by each pixel that the boundary lies from
  /// the principal point along its normal; and of the response [px].
  std::array<double, 4> doubt_of_radial{}, doubt_of_response_px{};

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
  LightTable light_of_value_;  // where it is not the rig's
  LightImage light_;
};

/// Effects beyond what `light` undoes already: of lateral chromatic aberration and a response that is not the rig's,
/// the one that explains where the three channels show the boundaries; nullopt where nothing needs explaining.
/// `blur_px` is what locate_edges was given. For processed images (picture_processing.h) it is arbitrary.
std::optional<CameraDeparture> find_departure(const LightImage& light, std::span<const Measurement> measurements,
                                              double blur_px);

/// By how much each boundary is seen farther along its normal, by an exponent of light that is larger by 1 [px]; 0
/// where it is not seen. `blur_px`: what locate_edges was given.
std::array<double, 4> moved_by_exponent_px(const LightImage& light, std::span<const Measurement> measurements,
                                           double blur_px);

}  // namespace lapservo::internal
