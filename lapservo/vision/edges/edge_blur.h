#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "lapservo/vision/edges/edge_lines.h"

namespace lapservo::internal {

/// A lens's in usual images, one sigma; the rest is motion's or defocus'.
inline constexpr double usual_blur_px = 1.2;

struct BlurLimits {
  /// The sharpest lens's. A lens's blur beyond it makes the correlation, which is fitted, smaller.
  double lens_blur_px = 0.8;
  /// Limits of a blur, and by how much a pass may change it: wider is no edge, and far steps overshoot.
  double min_blur_px = 0.5, max_blur_px = 8, min_blur_change = 0.6, max_blur_change = 1.7;
};
inline constexpr BlurLimits blur_limits;

/// The blur about one boundary: its variances along the shaft and across it, and their covariance.
struct BlurEllipse {
  double along_px2, across_px2, oblique_px2;

  /// One sigma along a normal whose parts along the shaft and across it these are.
  double along_normal_px(const Eigen::Vector2d& normal) const;
};

/// A boundary's course in the image about a point of it, in coordinates along the shaft and across it, and how the
/// light changes across the shaft there.
struct BoundaryCourse {
  double slope = 0;                ///< d(along)/d(across)
  double curvature_per_px = 0;     ///< d2(along)/d(across)2
  double light_change_per_px = 0;  ///< d(log light)/d(across)
};

/// How far along the shaft a wide blur moves a boundary: it mixes what lies beside on either side, and more of where
/// there is more light. To second order of the blur.
inline double moved_by_blur_px(const BoundaryCourse& course, const BlurEllipse& blur) {
  return (course.slope * blur.across_px2 - blur.oblique_px2) * course.light_change_per_px +
         0.5 * course.curvature_per_px * blur.across_px2;
}

/// Width of the blur (one sigma) of each boundary along the shaft and of the sides across it: that of a lens and of a
/// motion within the exposure, which moves each boundary by another length. Carried from frame to frame.
struct EdgeBlur {
  std::array<double, 4> along_px;
  double sides_px;
  double correlation = 0;  ///< of the motion along the shaft with that across it: 1 or -1 where it is even, oblique

  EdgeBlur() : EdgeBlur(usual_blur_px, usual_blur_px) {}
  /// The same along the shaft for all boundaries.
  EdgeBlur(double boundaries_px, double across_px) : sides_px(across_px) { along_px.fill(boundaries_px); }

  /// Mean of the boundaries'.
  double boundaries_px() const { return (along_px[0] + along_px[1] + along_px[2] + along_px[3]) / 4; }
  double widest_px() const { return std::max(std::ranges::max(along_px), sides_px); }
  BlurEllipse ellipse(std::size_t boundary) const;
};

/// Evidence of edges about one width of the blur.
struct BlurEvidence {
  double gradient = 0, information = 0;
  void add(const EdgeFit& edge, double variance) {
    gradient += edge.blur_gradient / variance;
    information += edge.blur_information / variance;
  }
  /// The blur after a Gauss-Newton step of limited size.
  double improved(double blur_px) const;
};

/// Evidence of the boundaries about the blur: they are not all inclined alike.
class EllipseEvidence {
 public:
  /// A point of a boundary that was located along the shaft with this blur; its normal along the shaft and across it.
  void add(const EdgeFit& edge, double variance, const EdgeBlur& blur, std::size_t boundary,
           const Eigen::Vector2d& normal);
  /// The blur after a Gauss-Newton step of limited size; the sides' as it is.
  EdgeBlur improved(const EdgeBlur& blur) const;

  /// The boundaries' squared blurs along the shaft after the whole step and their covariance, at any correlation.
  struct Squares {
    Eigen::Vector4d px2;
    Eigen::Matrix4d covariance;  // px^4
  };
  Squares squares(const EdgeBlur& blur) const;

 private:
  static constexpr int numbers = 5;  // the four boundaries' blurs, the correlation
  using Numbers = Eigen::Matrix<double, numbers, 1>;
  using Information = Eigen::Matrix<double, numbers, numbers>;

  // Gauss-Newton's, by what the boundaries say and what is expected.
  struct Step {
    Eigen::LDLT<Information> information;
    Numbers change;
  };
  Step step_from(const EdgeBlur& blur) const;

  Numbers gradient_ = Numbers::Zero();
  Information information_ = Information::Zero();
};

}  // namespace lapservo::internal
