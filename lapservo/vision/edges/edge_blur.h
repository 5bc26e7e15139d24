#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "lapservo/vision/edges/edge_profile.h"

namespace lapservo::internal {

/// Of a lens in usual pictures, one sigma; what is beyond is motion's or defocus'.
inline constexpr double usual_blur_px = 1.2;

/// When blur is wide, and how it changes from pass to pass.
struct BlurLimits {
  /// Beyond it blur is motion's or defocus', no lens's, and what it does to boundaries is modelled
  /// (blurred_boundary.h). Misplaced sides look wide, so boundaries must be wide, too, or the sides by more than a pass
  /// makes of usual ones.
  double wide_blur_px = 1.5, wide_along_blur_px = 1.3, wide_sides_px = 2.1;
  /// These are of shafts of this radius and thicker ones. Thinner ones are moved by more, as the blur's square by the
  /// radius beyond this.
  double unmoved_blur_px = 1.2, thick_radius_px = 36;
  /// Of wide blur, what is the sharpest lens's: what a lens does beyond makes the correlation smaller, which is fitted,
  /// and nothing makes it larger than 1.
  double lens_blur_px = 0.8;
  /// Of a blur, and by how much a pass may change it: wider is no edge, and far steps overshoot.
  double min_blur_px = 0.5, max_blur_px = 8, min_blur_change = 0.6, max_blur_change = 1.7;
};
inline constexpr BlurLimits blur_limits;

/// The blur about one boundary: its variances along the shaft and across it, and their covariance.
struct BlurEllipse {
  double along_px2, across_px2, oblique_px2;

  /// One sigma along a normal whose parts along the shaft and across it these are.
  double along_normal_px(const Eigen::Vector2d& normal) const;
};

/// Width of the blur (one sigma) along the boundaries' normals and across the shaft's sides: motion makes them differ.
/// Carried from frame to frame.
///
/// Wide blur is a lens's and that of a motion within the exposure. Turns about whatever axis move each boundary along
/// the shaft by another length, so each has a blur of its own there, of which boundaries_px is the mean.
struct EdgeBlur {
  double boundaries_px = usual_blur_px, sides_px = usual_blur_px;
  std::array<double, 4> along_px{boundaries_px, boundaries_px, boundaries_px, boundaries_px};
  double correlation = 0;  ///< of the motion along the shaft with that across it: 1 or -1 where it is even, oblique

  double radius_px = 1e3;  ///< the shaft's: thin ones are moved more

  /// Wider than a lens's, by what it does to boundaries.
  bool wide() const;
  double widest_px() const;
  /// Of wide blur.
  BlurEllipse ellipse(std::size_t boundary) const;
};

/// What the edges say about the blur.
struct BlurEvidence {
  double gradient = 0, information = 0;
  void add(const EdgeFit& edge, double variance) {
    gradient += edge.blur_gradient / variance;
    information += edge.blur_information / variance;
  }
  void add(const BlurEvidence& other) { gradient += other.gradient, information += other.information; }
  /// The blur after a Gauss-Newton step of limited size.
  double improved(double blur_px) const;
};

/// What the boundaries say about a wide blur: they are not all inclined alike.
class WideBlurEvidence {
 public:
  /// A point of a boundary that was located along the shaft with this blur, its normal's parts along the shaft and
  /// across it.
  void add(const EdgeFit& edge, double variance, const EdgeBlur& blur, std::size_t boundary,
           const Eigen::Vector2d& normal);
  /// The blur after a Gauss-Newton step of limited size; the sides' as it is.
  EdgeBlur improved(const EdgeBlur& blur) const;

 private:
  static constexpr int numbers = 5;  // the four boundaries' blurs, the correlation
  using Numbers = Eigen::Matrix<double, numbers, 1>;
  Numbers gradient_ = Numbers::Zero();
  Eigen::Matrix<double, numbers, numbers> information_ = Eigen::Matrix<double, numbers, numbers>::Zero();
};

}  // namespace lapservo::internal
