#pragma once

#include <optional>

#include <Eigen/Core>

namespace lapservo::internal {

/// The eight numbers of an image: s_rad, r_px, l_px, d_px, then the end points e0 u, v, e3 u, v.
using ImageVector = Eigen::Matrix<double, 8, 1>;

/// Least squares of y = y0 + G x for four inputs and eight outputs, all in units of their scale.
class AffineFit {
 public:
  struct Solution {
    ImageVector at_zero = ImageVector::Zero();
    Eigen::Matrix<double, 8, 4> gradient = Eigen::Matrix<double, 8, 4>::Zero();
    Eigen::Matrix<double, 5, 5> covariance = Eigen::Matrix<double, 5, 5>::Zero();  ///< of (y0, G row), unit noise
    double squares = 0;                                                            ///< sum of squared residuals
  };

  void add(const Eigen::Vector4d& x, const ImageVector& y);
  /// nullopt when the inputs do not span all four directions.
  std::optional<Solution> solve() const;

 private:
  Eigen::Matrix<double, 5, 5> normal_ = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 8> mixed_ = Eigen::Matrix<double, 5, 8>::Zero();
  double squares_ = 0;
  int samples_ = 0;
};

}  // namespace lapservo::internal
