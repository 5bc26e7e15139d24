#include "lapservo/control/tracking_law.h"

#include <cmath>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "lapservo/core/angles.h"

namespace lapservo::internal {

TrackingGains paper_gains(double control_period_s) {
  return {Eigen::Vector4d(0.032, 0.008, 0.0008, 0.01) / control_period_s};
}

double exact_gain_ramped(double decay_per_s, double period_s) {
  const double decay_per_period = decay_per_s * period_s;
  return 2 / period_s * std::exp(-decay_per_period) * std::tanh(decay_per_period / 2);
}

Eigen::Vector4d feature_error(const Eigen::Vector4d& features, const Eigen::Vector4d& desired) {
  Eigen::Vector4d error = features - desired;
  error[0] = wrap_pi(error[0]);
  return error;
}

Eigen::Vector4d wanted_feature_rate(const TrackingGains& gains, const Eigen::Vector4d& features,
                                    const Eigen::Vector4d& desired, const Eigen::Vector4d& desired_rate) {
  return desired_rate - gains.per_s.cwiseProduct(feature_error(features, desired));
}

DampedInverse damped_inverse(const Eigen::Matrix4d& jacobian, const Scales& scales, double threshold) {
  const Eigen::Matrix4d scaled = scales.features.cwiseInverse().asDiagonal() * jacobian * scales.joints.asDiagonal();
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(scaled, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector4d inverted;
  for (int i = 0; i < 4; ++i) {
    const double sigma = svd.singularValues()[i];
    // sigma^2 + damping^2 with damping^2 = (1 - (sigma / threshold)^2) threshold^2 is threshold^2.
    inverted[i] = sigma >= threshold ? 1 / sigma : sigma / (threshold * threshold);
  }
  DampedInverse result;
  result.min_singular_value = svd.singularValues()[3];
  result.inverse = scales.joints.asDiagonal() * svd.matrixV() * inverted.asDiagonal() * svd.matrixU().transpose() *
                   scales.features.cwiseInverse().asDiagonal();
  return result;
}

Eigen::Vector4d paper_velocity(const Eigen::Matrix4d& jacobian, const TrackingGains& gains,
                               const Eigen::Vector4d& features, const Eigen::Vector4d& desired,
                               const Eigen::Vector4d& desired_rate) {
  return jacobian.inverse() * wanted_feature_rate(gains, features, desired, desired_rate);
}

}  // namespace lapservo::internal
