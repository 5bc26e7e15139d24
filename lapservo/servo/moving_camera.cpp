#include "lapservo/servo/moving_camera.h"

#include <utility>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/servo/image_features.h"

namespace lapservo::internal {
namespace {

constexpr double added_share = 0.01;  // of an endoscope's motion, to sigma
constexpr double step_s = 0.03;       // of differences by time

}  // namespace

Instrument before_moved_camera(Instrument first, const Rigid3& first_from_camera) {
  const Rigid3 camera_from_first = first_from_camera.inverse();
  const Rigid3 moved = camera_from_first * *first.camera_from_rcm;
  using Matrix = Eigen::Matrix<double, 6, 6>;
  Matrix turn = Matrix::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = camera_from_first.rotation.toRotationMatrix();
  const double sigma_m = added_share * first_from_camera.translation.norm();
  const double sigma_rad = added_share * rotation_vector_of(first_from_camera.rotation).norm();
  Matrix by_motion = Matrix::Identity();
  by_motion.topRightCorner<3, 3>() = Eigen::Matrix3d::Identity().colwise().cross(moved.translation);
  Eigen::Vector<double, 6> added;
  added << Eigen::Vector3d::Constant(sigma_m * sigma_m), Eigen::Vector3d::Constant(sigma_rad * sigma_rad);
  first.registration_covariance =
      turn * registration_covariance(first) * turn.transpose() + by_motion * added.asDiagonal() * by_motion.transpose();
  first.camera_from_rcm = moved;
  return first;
}

MovingCamera::MovingCamera(const EndoscopePose& endoscope, const Rig& rig, const Scales& scales)
    : endoscope_(endoscope), rig_(rig), scales_(scales) {
  use(rig.instruments.at(0).camera_from_rcm.value());
}

void MovingCamera::use(const std::optional<Rigid3>& first_from_rcm) {
  first_from_rcm_ = first_from_rcm;
  first_ = feature_model(rig_, first_from_rcm);
}

void MovingCamera::carry(ServoInput& input, double since_s, const Trajectory& trajectory,
                         const Rigid3& first_from_camera) {
  const Eigen::Vector4d q = input.joints.q.vector();
  if (!begun_ && !q.allFinite()) return;
  const bool begins = !std::exchange(begun_, true);
  if (begins) last_ = input.desired;
  // An arm that the loop does not move is brought elsewhere by others.
  if (begins || (q.allFinite() && input.joints.operating_state != OperatingState::enabled)) wanted_ = q;
  const auto now = features_in_first(input.time_s, input.desired.features);
  if (first_from_rcm_ && !now) input.image.reset();
  if (input.image) carry(*input.image, first_from_camera, q);
  const HoldReason hold = input.desired.hold;
  input.desired = last_;
  input.desired.hold = hold;
  input.desired.rate.setZero(), input.desired.acceleration.setZero();
  if (!now) return;
  input.desired.features = *now;
  const auto before = features_in_first(input.time_s - step_s, trajectory.at(since_s - step_s).features);
  const auto after = features_in_first(input.time_s + step_s, trajectory.at(since_s + step_s).features);
  if (before && after) {
    const Eigen::Vector4d back = feature_error(*now, *before), on = feature_error(*after, *now);
    input.desired.rate = (on + back) / (2 * step_s);
    input.desired.acceleration = (on - back) / (step_s * step_s);
  }
  last_ = input.desired;
}

void MovingCamera::carry(ImageMeasurement& image, const Rigid3& first_from_camera, const Eigen::Vector4d& q) const {
  if (image.camera_from_marker) image.camera_from_marker = first_from_camera * *image.camera_from_marker;
  if (!image.found || !first_from_rcm_) return;
  const FeatureModel model = feature_model(rig_, first_from_camera.inverse() * *first_from_rcm_);
  const auto seen = newton_inverse(model, image.features, image.q.value_or(q), scales_);
  const auto there = seen ? model(seen->q) : std::nullopt, first = seen ? first_(seen->q) : std::nullopt;
  if (!there || !first) {
    image.found = false;
    return;
  }
  const Eigen::Matrix4d first_by_here = first->jacobian * damped_inverse(there->jacobian, scales_).inverse;
  image.features = first->features + first_by_here * seen->residual;
  const Eigen::Matrix4d covariance = first_by_here * image.covariance * first_by_here.transpose();
  image.covariance = 0.5 * (covariance + covariance.transpose());  // a log holds one half of it
  image.ends_px += first->ends_px - there->ends_px;
}

std::optional<Rigid3> MovingCamera::camera_from_rcm(double time_s) const {
  const auto first_from_camera = endoscope_.first_from_camera(time_s);
  if (!first_from_camera || !first_from_rcm_) return std::nullopt;
  return first_from_camera->inverse() * *first_from_rcm_;
}

std::optional<Eigen::Vector4d> MovingCamera::features_in_first(double time_s, const Eigen::Vector4d& desired) {
  const auto here_from_rcm = camera_from_rcm(time_s);
  if (!here_from_rcm) return std::nullopt;
  const FeatureModel model = feature_model(rig_, *here_from_rcm);
  const auto found = newton_inverse(model, desired, wanted_, scales_);
  const auto first = found && found->converged ? first_(found->q) : std::nullopt;
  if (!first) return std::nullopt;
  wanted_ = found->q;
  return first->features;
}

}  // namespace lapservo::internal
