#pragma once

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/probing.h"

namespace lapservo::internal {

/// Learns image and Jacobian online from measured joints and features alone: no camera, marker or registration. The
/// model is y(q) = y0 + G (q - q0) about the latest image's joints q0. G follows a random walk whose steps grow with
/// the motion since the image before, so what was learnt of it is forgotten by distance, not by time, and at rest not
/// at all (no wind-up, and no noise is learnt); y0 walks by time too. It is recursive least squares, in the form of a
/// Kalman filter with one 5x5 covariance shared by all eight outputs, since their regressors and scaled noise are the
/// same. The more a step of G outweighs all else (bend -> infinity), the nearer it comes to Broyden's rank-one update.
/// Compare Jagersand, Fuentes and Nelson 1997, Hosoda and Asada 1994.
class JacobianEstimator {
 public:
  JacobianEstimator(const JacobianEstimatorConfig& config, const Scales& scales, const ProbedModel& start);

  /// An image taken at joints `q_then`, `interval_s` after the one before. False for an outlier, which is ignored,
  /// unless reacquire_after of them in a row agree.
  bool update(const Eigen::Vector4d& q_then, const Eigen::Vector4d& features, const Eigen::Vector4d& ends_px,
              double interval_s);

  /// The model at q; the Jacobian is the same everywhere.
  FeatureState at(const Eigen::Vector4d& q) const;
  /// Variance of a feature at q in feature scales, from noise and what the walk adds up to there.
  double variance_at(const Eigen::Vector4d& q) const;

 private:
  void move_to(const Eigen::Vector4d& q, double interval_s);

  JacobianEstimatorConfig config_;
  Scales scales_;
  Eigen::Vector4d q_;                       ///< q0
  Eigen::Matrix<double, 5, 8> parameters_;  ///< y0 and G^T, in scales
  Eigen::Matrix<double, 5, 5> covariance_;
  int outliers_ = 0;                                ///< in a row that agree with one another
  ImageVector last_outlier_ = ImageVector::Zero();  ///< the last one's innovation
};

}  // namespace lapservo::internal
