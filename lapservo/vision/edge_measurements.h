#pragma once

#include <array>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edge_blur.h"
#include "lapservo/vision/light_image.h"
#include "lapservo/vision/scene.h"
#include "lapservo/vision/shaft_pose.h"

namespace lapservo::internal {

/// Thickness of the film that carries the marker and stands out from the shaft, before a fit: mean and standard
/// deviation. Where an end is seen from beyond, the cut edge of the film is seen too, and the boundary that is measured
/// lies below the film's outside, nearer to the axis: by the thickness where the edge is as bright as the outside, by
/// less or more as it is darker or brighter (lit diffusely from the camera, with some ambient light). The rig does not
/// say how thick the film is, so each fit estimates it.
inline constexpr double film_mean_m = 0.07e-3, film_sigma_m = 0.04e-3;

/// How far one point of an edge in the image lies from where a pose has it.
struct Measurement {
  UnknownVector row;   ///< d(position along the image normal)/d(unknowns, then film thickness in film_sigma_m) [px]
  double residual_px;  ///< along the normal
  double sigma_px;
  double film_sigma_px = 0;  ///< of it, what the film's edge leaves in doubt: alike for all of an end
  std::size_t group;          ///< 0..3: the boundary; 4 and 5: the sides
  double turn_fraction = 0;   ///< tau by what the print covers
  double along_px_per_m = 0;  ///< how it moves with the boundary's place along the shaft; 0 of sides
  double across = 0;          ///< of boundaries: from -1 to 1, from side to side of the shaft
  Eigen::Vector2f expected_px{0, 0}, normal{0, 0};  ///< where the pose has it, and the image normal; of sides inwards
  float clear_px = 0;  ///< of boundaries: how far along the normal no other boundary and its blur reaches
};
inline constexpr std::size_t measurement_groups = 6;

/// How far beyond the blur a pass looks for edges, how often it refines each before the pose, and which fraction of the
/// generatrices and stations it uses: one of so many.
struct Effort {
  double extra_px;
  int iterations;
  int thinning;
};

/// Everything that a frame shows of a marker's boundaries and of its shaft's sides near a pose.
struct EdgeMeasurements {
  static constexpr int max_lines = 64, max_stations = 24;
  static constexpr std::size_t most = 4 * max_lines + 2 * max_stations;
  InplaceVector<Measurement, most> all;
  std::array<int, 4> in_image{};  ///< lines on which the boundary lies inside the image and off the seam
  int sides_in_image = 0;         ///< stations on which a side lies inside the image and off the boundaries
  int lines = 0;                  ///< generatrices looked at
  double radius_px = 0;           ///< the shaft's
  std::array<BlurEvidence, 4> boundary_blurs;
  BlurEvidence side_blur;
  WideBlurEvidence wide_blur;  ///< where the blur that they were located with is wide

  /// The blur that they were located with after a step.
  EdgeBlur improved(const EdgeBlur& blur) const;
};

/// Looks around `unknowns` in linear light, to a fraction of a pixel. Nothing when the pose shows no shaft.
EdgeMeasurements measure_edges(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns, double film_m,
                               const Effort& effort, const EdgeBlur& blur);

}  // namespace lapservo::internal
