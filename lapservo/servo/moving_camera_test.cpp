#include "lapservo/servo/moving_camera.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/control/tracking_law.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::moving_camera_test {

const JointVector there{0.05, 1.57, 0.064, 1.2};

// Turns and goes evenly; nobody knows where it is before 0.
struct Evenly : EndoscopePose {
  Eigen::Vector3d turn_rad_s{0.02, -0.03, 0.04}, way_m_s{0.004, 0.002, -0.003};
  std::optional<Rigid3> first_from_camera(double time_s) const override {
    if (time_s < 0) return std::nullopt;
    return Rigid3{rotation_by(time_s * turn_rad_s), time_s * way_m_s};
  }
};

ServoInput input_at(double time_s, const JointVector& q) {
  ServoInput input;
  input.time_s = time_s;
  input.joints.q = q;
  return input;
}

class MovingCameraTest : public ::testing::Test {
 protected:
  const Rig rig = testing::small_test_rig();
  Evenly endoscope;
  MovingCamera camera{endoscope, rig, {}};
};

// As the first one would see them, with their derivatives.
TEST_F(MovingCameraTest, ImagesAreCarriedToThoseOfTheFirstPlace) {
  const Rigid3& first_from_rcm = *rig.instruments[0].camera_from_rcm;
  const FeatureModel first = feature_model(rig);
  Random random(1);
  for (int k = 0; k < 10; ++k) {
    const double time_s = random.uniform(0.5, 3);
    const Rigid3 camera_from_rcm = endoscope.first_from_camera(time_s)->inverse() * first_from_rcm;
    const FeatureModel here = feature_model(rig, camera_from_rcm);
    const Eigen::Vector4d q = there.vector() + 0.02 * Eigen::Vector4d(random.normal(), random.normal(), 0, 1);
    ServoInput input = input_at(time_s, there);
    const auto seen = here(q), expected = first(q);
    ASSERT_TRUE(seen && expected);
    input.image.emplace();
    input.image->found = true;
    input.image->features = seen->features;
    input.image->ends_px = seen->ends_px;
    input.image->covariance = seen->jacobian * seen->jacobian.transpose();
    input.image->camera_from_marker = camera_from_rcm;
    input.desired.features = here(there.vector())->features;
    camera.carry(input, 0, set_point(input.desired.features), *endoscope.first_from_camera(time_s));
    ASSERT_TRUE(input.image && input.image->found);
    EXPECT_LT((input.image->features - expected->features).norm(), 1e-6);
    EXPECT_LT((input.image->ends_px - expected->ends_px).norm(), 1e-4);
    const Eigen::Matrix4d covariance = expected->jacobian * expected->jacobian.transpose();
    EXPECT_LT((input.image->covariance - covariance).norm(), 1e-6 * covariance.norm());
    EXPECT_LT((input.image->camera_from_marker->translation - first_from_rcm.translation).norm(), 1e-12);
  }
}

// A goal that rests in the moving image moves in that of the first place: an arm that follows it keeps it in the moving
// image, and its rate and acceleration are its derivatives.
TEST_F(MovingCameraTest, GoalsMoveAsTheCameraDoes) {
  const FeatureModel first = feature_model(rig);
  const Eigen::Vector4d goal = first(there.vector())->features;
  const auto desired_at = [&](double time_s) {
    ServoInput input = input_at(time_s, there);
    input.desired.features = goal;
    camera.carry(input, time_s, set_point(goal), {});
    return input.desired;
  };
  constexpr double step_s = 0.01;
  for (double time_s = 0.1; time_s < 2; time_s += 0.2) {
    const DesiredFeatures before = desired_at(time_s - step_s), after = desired_at(time_s + step_s);
    const DesiredFeatures now = desired_at(time_s);
    const Eigen::Vector4d rate = feature_error(after.features, before.features) / (2 * step_s);
    EXPECT_GT(rate.tail<3>().norm(), 1) << "it moves";
    EXPECT_LT((now.rate - rate).norm(), 1e-3 * rate.norm());
    EXPECT_LT((now.acceleration - (after.rate - before.rate) / (2 * step_s)).norm(), 0.2 * rate.norm());
  }
}

TEST_F(MovingCameraTest, WhereTheEndoscopeIsNotKnownTheGoalRestsAndNoImageCounts) {
  ServoInput input = input_at(-1, there);
  input.image.emplace();
  input.desired = {feature_model(rig)(there.vector())->features, Eigen::Vector4d::Ones(), Eigen::Vector4d::Ones(),
                   HoldReason::tip_unreachable};
  const Eigen::Vector4d goal = input.desired.features;
  camera.carry(input, 0, set_point(goal), {});
  EXPECT_FALSE(input.image);
  EXPECT_EQ(input.desired.features, goal);
  EXPECT_TRUE(input.desired.rate.isZero() && input.desired.acceleration.isZero());
  EXPECT_EQ(input.desired.hold, HoldReason::tip_unreachable);
}

// Joints that are not known at first leave nothing behind; a goal that no q shows holds the arm.
TEST_F(MovingCameraTest, GoesOnAfterJointsThatAreNoneAndGoalsOutOfReach) {
  const Eigen::Vector4d goal = feature_model(rig)(there.vector())->features,
                        beyond = goal + Eigen::Vector4d(0, 0, -200, 0);
  const auto image_counts = [&](const JointVector& q, const Eigen::Vector4d& desired) {
    ServoInput input = input_at(1, q);
    input.image.emplace();
    input.desired.features = desired;
    camera.carry(input, 0, set_point(desired), *endoscope.first_from_camera(1));
    return input.image.has_value();
  };
  image_counts({std::nan(""), 0, 0, 0}, goal);
  EXPECT_TRUE(image_counts(there, goal));
  EXPECT_FALSE(image_counts(there, beyond));
  EXPECT_TRUE(image_counts(there, goal));
}

// A goal is looked for from where the arm is when the loop begins to move it, not from where others had it.
TEST_F(MovingCameraTest, GoalsAreLookedForFromWhereTheArmIsEnabled) {
  const double time_s = 3;
  const FeatureModel here =
      feature_model(rig, endoscope.first_from_camera(time_s)->inverse() * *rig.instruments[0].camera_from_rcm);
  const Eigen::Vector4d goal = here(there.vector())->features;
  for (const JointVector& q : {JointVector{0, pi / 2, -0.0156, 0}, there}) {
    ServoInput input = input_at(time_s, q);
    input.joints.operating_state = OperatingState::paused;
    for (int i = 0; i < 2; ++i, input.joints.operating_state = OperatingState::enabled) {
      if (i == 1 && q.rho_m < 0) break;  // others bring it elsewhere first
      input.desired.features = goal;
      camera.carry(input, 0, set_point(goal), *endoscope.first_from_camera(time_s));
    }
    if (q.rho_m > 0) {
      EXPECT_LT((input.desired.features - feature_model(rig)(there.vector())->features).norm(), 1e-6);
    }
  }
}

// The covariance is that of registrations whose first one, and whose motion, are drawn from their own.
TEST(BeforeMovedCamera, TheMotionsUncertaintyIsAdded) {
  Instrument instrument = testing::small_test_rig().instruments[0];
  instrument.registration_covariance =
      Eigen::Vector<double, 6>(1e-8, 4e-8, 9e-8, 1e-6, 2e-6, 3e-6).asDiagonal().toDenseMatrix();
  const Rigid3 resting;
  EXPECT_LT(
      (*before_moved_camera(instrument, resting).registration_covariance - *instrument.registration_covariance).norm(),
      1e-15);
  const Rigid3 first_from_camera{rotation_by({0.1, 0.15, -0.05}), {0.01, -0.015, 0.005}};
  const Instrument moved = before_moved_camera(instrument, first_from_camera);
  const double sigma_rad = 0.01 * Eigen::Vector3d(0.1, 0.15, -0.05).norm();
  const double sigma_m = 0.01 * first_from_camera.translation.norm();
  Random random(2);
  const auto draw = [&](double sigma) {
    return Eigen::Vector3d(sigma * random.normal(), sigma * random.normal(), sigma * random.normal());
  };
  constexpr int count = 20000;
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (int k = 0; k < count; ++k) {
    const Eigen::Array<double, 6, 1> sigmas = instrument.registration_covariance->diagonal().array().sqrt();
    const Rigid3 first{
        rotation_by(draw(1).cwiseProduct(sigmas.tail<3>().matrix())) * instrument.camera_from_rcm->rotation,
        instrument.camera_from_rcm->translation + draw(1).cwiseProduct(sigmas.head<3>().matrix())};
    const Rigid3 off{rotation_by(draw(sigma_rad)), draw(sigma_m)};
    const Rigid3 drawn = off * first_from_camera.inverse() * first;
    Eigen::Vector<double, 6> error;
    error << drawn.translation - moved.camera_from_rcm->translation,
        rotation_vector_of(drawn.rotation * moved.camera_from_rcm->rotation.conjugate());
    sum += error * error.transpose() / count;
  }
  const Eigen::Matrix<double, 6, 6>& told = *moved.registration_covariance;
  for (const int part : {0, 3})
    EXPECT_LT((sum - told).block(part, part, 3, 3).norm(), 0.05 * told.block(part, part, 3, 3).norm()) << part;
}

}  // namespace lapservo::internal::moving_camera_test
