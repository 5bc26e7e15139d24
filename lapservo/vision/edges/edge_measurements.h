#pragma once

#include <array>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/edge_blur.h"
#include "lapservo/vision/edges/film_edge.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Which points of edges count, and for how much.
struct EdgeLimits {
  int min_lines = 12;       ///< generatrices of a pass
  double line_reach = 0.9;  ///< of the visible half width: beyond, light and resolution are gone
  /// What the model leaves out of single points (`accuracy_study edges`): tissue beside a side is not even.
  double single_floor_px = 0.016, side_floor_px = 0.09;
  double interpolation_noise = 1.6;        ///< of the variance: interpolated samples are smoother than pixels are noisy
  double blurred_ambient_fraction = 0.05;  ///< of the light on the shaft, the even part
  double blur_reach = 2.5;                 ///< blurs: so far about an edge light is not what it is beside it
  double least_line_reach = 0.6;           ///< lines end blur_reach before a side, but no nearer to the middle
  double min_normal_cosine = 0.3;          ///< between the boundary's normal and the line that is sampled
  double max_side_sigma_px = 2;            ///< a side less certain says nothing
  std::size_t min_alike = 3;               ///< points whose colours agree, for what a boundary's change of light is
  std::size_t min_side_edges = 4;          ///< for how noisy a side is

  /// A change of light is the boundary's when it is at least this fraction of what most have, and its direction in the
  /// three channels this alike (cosine squared).
  float min_step = 0.25F, least_alike = 0.7F;
  /// And what it leaves at most this fraction of it (squared), beyond what all leave.
  float max_residual = 0.05F;
  int max_residual_sigmas = 3;  ///< of the typical residuals

  /// One sigma of what the film moves a point by: this fraction of its square, by the blur. At the true pose (60
  /// frames, leaning by up to 60 degrees) 0.01 px are left of 0.3 px, 0.05 of 0.5, 0.06 of 0.9.
  double film_doubt = 0.3;
  /// About the seam and boundaries colours mix: ones that jump at the seam, by this and blur_reach near, are left out.
  double seam_px = 1.5;
};
inline constexpr EdgeLimits edge_limits;

/// Thickness of the film that carries the marker and stands out from the shaft (film_edge.h), before a fit: mean and
/// standard deviation. The rig does not say how thick it is, so each fit estimates it.
inline constexpr double film_mean_m = 0.07e-3, film_sigma_m = 0.04e-3;

/// How far one point of an edge in the image lies from where a pose has it.
struct Measurement {
  UnknownVector row;   ///< d(position along the image normal)/d(unknowns, then film thickness in film_sigma_m) [px]
  double residual_px;  ///< along the normal
  double sigma_px;
  std::size_t group;          ///< 0..3: the boundary; 4 and 5: the sides
  double turn_fraction = 0;   ///< tau by what the print covers
  double along_px_per_m = 0;  ///< how it moves with the boundary's place along the shaft; 0 of sides
  double across = 0;          ///< of boundaries: from -1 to 1, from side to side of the shaft
  Eigen::Vector2f expected_px{0, 0}, normal{0, 0};  ///< where the pose has it, and the image normal; of sides inwards
  std::array<float, 3> channel_px{};  ///< where b, g, r show it from there: in the light of the film's edge
  float clear_px = 0;  ///< of boundaries: how far along the normal no other boundary and its blur reaches
};
inline constexpr std::size_t measurement_groups = 6;

/// How far beyond the blur a pass looks for boundaries and for sides, how often it refines each before the pose, and
/// which fraction of the generatrices and stations it uses: one of so many. Surroundings of the shaft are less even
/// than its bands: where a side's place is known to a pixel, 2 px beyond the blur make its error half as large again.
struct Effort {
  double extra_px, extra_of_sides_px;
  int iterations;
  int thinning;
};

/// Where edges were looked for.
struct PlacesLookedAt {
  int lines = 0;                  ///< generatrices
  std::array<int, 4> in_image{};  ///< of them, lines on which the boundary lies inside the image and off the seam
  int sides_in_image = 0;         ///< stations on which a side lies inside the image and off the boundaries
};

/// Everything that a frame shows of a marker's boundaries and of its shaft's sides near a pose.
struct EdgeMeasurements : PlacesLookedAt {
  static constexpr int max_lines = max_end_points, max_stations = 24;
  static constexpr std::size_t most = 4 * max_lines + 2 * max_stations;
  InplaceVector<Measurement, most> all;
  double radius_px = 0;  ///< the shaft's
  EllipseEvidence ellipse;
  BlurEvidence side_blur;

  /// The blur that they were located with after a step.
  EdgeBlur improved(const EdgeBlur& blur) const {
    EdgeBlur next = ellipse.improved(blur);
    next.sides_px = side_blur.improved(blur.sides_px);
    return next;
  }
};

/// Looks around `unknowns` in linear light, to a fraction of a pixel. Nothing when the pose shows no shaft.
EdgeMeasurements measure_edges(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns, double film_m,
                               const Effort& effort, const EdgeBlur& blur);

}  // namespace lapservo::internal
