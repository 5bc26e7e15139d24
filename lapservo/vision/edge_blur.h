#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

#include "lapservo/vision/edge_profile.h"

namespace lapservo::internal {

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
  double boundaries_px = 1.2, sides_px = 1.2;
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
