#include "lapservo/control/jacobian_estimator.h"

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {

using Regressor = Eigen::Matrix<double, 5, 1>;

JacobianEstimator::JacobianEstimator(const JacobianEstimatorConfig& config, const Scales& scales,
                                     const ProbedModel& start)
    : config_(config), scales_(scales), q_(start.q), covariance_(start.fit.covariance * (config.noise * config.noise)) {
  parameters_ << start.fit.at_zero.transpose(), start.fit.gradient.transpose();
}

void JacobianEstimator::move_to(const Eigen::Vector4d& q, double interval_s) {
  const Eigen::Vector4d moved = (q - q_).cwiseQuotient(scales_.joints);
  const double distance = moved.norm();
  Eigen::Matrix<double, 5, 5> transition = Eigen::Matrix<double, 5, 5>::Identity();
  transition.block<1, 4>(0, 1) = moved.transpose();
  parameters_ = (transition * parameters_).eval();
  covariance_ = (transition * covariance_ * transition.transpose()).eval();
  covariance_(0, 0) += config_.walk * config_.walk * interval_s + config_.slack * config_.slack * distance * distance;
  covariance_.diagonal().tail<4>().array() += config_.bend * config_.bend * distance;
  q_ = q;
}

bool JacobianEstimator::update(const Eigen::Vector4d& q_then, const Eigen::Vector4d& features,
                               const Eigen::Vector4d& ends_px, double interval_s) {
  move_to(q_then, interval_s);
  const Eigen::Vector4d expected = parameters_.row(0).head<4>().transpose().cwiseProduct(scales_.features);
  ImageVector innovation;
  innovation << feature_error(features, expected).cwiseQuotient(scales_.features),
      ends_px - parameters_.row(0).tail<4>().transpose();
  const double variance = covariance_(0, 0) + config_.noise * config_.noise;
  if (innovation.head<4>().squaredNorm() > config_.gate_chi2 * variance) {
    const bool agrees = (innovation - last_outlier_).head<4>().squaredNorm() < config_.gate_chi2 * variance;
    outliers_ = outliers_ > 0 && agrees ? outliers_ + 1 : 1;
    last_outlier_ = innovation;
    if (outliers_ < config_.reacquire_after) return false;
    // Elsewhere than thought: what is known of G stays, y0 starts anew.
    parameters_.row(0) += innovation.transpose();
    covariance_.row(0).setZero();
    covariance_.col(0).setZero();
    covariance_(0, 0) = config_.noise * config_.noise;
    outliers_ = 0;
    return true;
  }
  outliers_ = 0;
  const Regressor gain = covariance_.col(0) / variance;
  parameters_ += gain * innovation.transpose();
  covariance_ -= (gain * covariance_.row(0)).eval();
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  return true;
}

FeatureState JacobianEstimator::at(const Eigen::Vector4d& q) const {
  const Eigen::Vector4d x = (q - q_).cwiseQuotient(scales_.joints);
  const ImageVector y = parameters_.row(0).transpose() + parameters_.bottomRows<4>().transpose() * x;
  const Eigen::Matrix<double, 8, 4> gradient =
      parameters_.bottomRows<4>().transpose() * scales_.joints.cwiseInverse().asDiagonal();
  return {y.head<4>().cwiseProduct(scales_.features), scales_.features.asDiagonal() * gradient.topRows<4>(),
          y.tail<4>(), gradient.bottomRows<4>()};
}

double JacobianEstimator::variance_at(const Eigen::Vector4d& q) const {
  Regressor regressor;
  regressor << 1, (q - q_).cwiseQuotient(scales_.joints);
  return regressor.dot(covariance_ * regressor);
}

}  // namespace lapservo::internal
