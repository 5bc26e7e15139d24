#include "lapservo/crtk/dvrk_frames.h"

#include <array>
#include <cmath>
#include <numbers>
#include <sstream>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::dvrk_frames_test {

constexpr double right_angle = std::numbers::pi / 2;

// A link of modified DH.
Eigen::Isometry3d link(double alpha, double theta, double d) {
  return Eigen::AngleAxisd(alpha, Eigen::Vector3d::UnitX()) * Eigen::Translation3d(0, 0, 0) *
         Eigen::AngleAxisd(theta, Eigen::Vector3d::UnitZ()) * Eigen::Translation3d(0, 0, d);
}

// dVRK's local/measured_cp of a straight tool's shaft: PSM.json and the roll of LARGE_NEEDLE_DRIVER_420006.json, whose
// origin lies at the wrist.
Eigen::Isometry3d psm_shaft(const Eigen::Vector4d& joints) {
  return link(right_angle, joints[0] + right_angle, 0) * link(-right_angle, joints[1] - right_angle, 0) *
         link(right_angle, 0, joints[2] - 0.4318) * link(0, joints[3], 0.4162);
}

// measured_cp as dVRK reports it after set_base_frame: base_frame * local/measured_cp.
Eigen::Isometry3d measured_cp(const Rigid3& base_frame, const Eigen::Vector4d& joints) {
  return Eigen::Translation3d(base_frame.translation) * base_frame.rotation * psm_shaft(joints);
}

// An arm whose marker begins where its wrist is, with tau = 0 at roll 0, in one of the two conventions.
Instrument psm(int yaw_sign, Random& random) {
  Instrument instrument = testing::small_test_rig().instruments.front();
  Joints joints;
  joints.names = {"yaw", "pitch", "insertion", "roll"};
  joints.sign = {static_cast<double>(yaw_sign), static_cast<double>(-yaw_sign), 1, 1};
  joints.offset = {random.uniform(-3, 3), right_angle, 0.4162 - 0.4318, 0};
  instrument.joints = joints;
  instrument.camera_from_rcm = {
      Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal()).normalized(),
      {random.normal(), random.normal(), random.normal()}};
  return instrument;
}

const JointRanges ranges{{-0.4, -0.3, 0.1, -1}, {0.5, 0.2, 0.15, 1}};

// Up to dVRK's camera convention: origin to 1e-6 m and axis to 1e-6, and the roll turns with psi.
TEST(DvrkFrames, AfterSetBaseFrameMeasuredCpLiesWhereTheMarkersPoseSays) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Instrument instrument = psm(seed % 2 ? 1 : -1, random);
    const DvrkBase base = dvrk_base(instrument, ranges, "rig");
    EXPECT_LT(base.worst_axis_rad, 1e-7);
    const Rigid3 base_frame = dvrk_from_camera() * base.camera_from_base;
    std::optional<double> roll_offset;
    for (int k = 0; k < 10; ++k) {
      Eigen::Vector4d joints;
      for (int i = 0; i < 4; ++i) {
        const auto at = static_cast<std::size_t>(i);
        joints[i] = random.uniform(ranges.low[at] - 0.1, ranges.high[at] + 0.1);
      }
      const auto q = JointVector::from_vector(q_from_joints(*instrument.joints, joints));
      const Rigid3 seen = dvrk_from_camera() * camera_from_marker(instrument.marker, *instrument.camera_from_rcm, q);
      const Eigen::Isometry3d told = measured_cp(base_frame, joints);
      EXPECT_LT((told.translation() - seen.translation).norm(), 1e-6);
      const Eigen::Matrix3d turn = seen.rotation.toRotationMatrix().transpose() * told.linear();
      EXPECT_LT((turn.col(2) - Eigen::Vector3d::UnitZ()).norm(), 1e-6);
      const double roll = std::atan2(turn(1, 0), turn(0, 0));
      EXPECT_NEAR(std::remainder(roll - roll_offset.value_or(roll), 2 * std::numbers::pi), 0, 1e-6);
      roll_offset = roll;
    }
  }
}

// A pitch encoder that is off by 10 mrad is said, and the base frame takes most of it up where the arm works.
TEST(DvrkFrames, AnEncoderThatIsOffIsSaid) {
  Random random(1);
  Instrument instrument = psm(1, random);
  instrument.joints->offset[1] += 0.01;
  const DvrkBase base = dvrk_base(instrument, ranges, "rig");
  EXPECT_GT(base.worst_axis_rad, 1e-3);
  EXPECT_LT(base.worst_axis_rad, 0.01);
}

TEST(DvrkFrames, SignsThatNoPsmHasAreRefused) {
  Random random(1);
  for (const std::array<double, 4>& sign :
       {std::array<double, 4>{1, 1, 1, 1}, {-1, -1, 1, 1}, {1, -1, -1, 1}, {1, -1, 1, -1}}) {
    Instrument instrument = psm(1, random);
    instrument.joints->sign = sign;
    EXPECT_THROW(dvrk_base(instrument, ranges, "rig"), InputError);
  }
}

// The 16 numbers after a key.
Eigen::Matrix4d matrix_after(const std::string& json, const std::string& key) {
  std::string numbers = json.substr(json.find("\"" + key + "\":") + key.size() + 3);
  for (char& c : numbers)
    if (std::string("[],{}\n").find(c) != std::string::npos) c = ' ';
  std::istringstream text(numbers);
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
  for (int i = 0; i < 16; ++i) text >> matrix(i / 4, i % 4);
  EXPECT_FALSE(text.fail()) << json;
  return matrix;
}

// SUJ_Fixed sets the base frame to (ECM's local/measured_cp)^-1 * its own measured_cp of the arm: where the ECM was, it
// is that of a camera that rests; elsewhere it is that of a camera that the ECM carries along.
TEST(DvrkFrames, BothFilesSayTheSameBaseFrameWhereTheEcmWas) {
  Random random(3);
  const Rigid3 base = dvrk_base(psm(1, random), ranges, "rig").camera_from_base;
  const Rigid3 ecm{Eigen::Quaterniond(0.2, -0.3, 0.7, 0.1).normalized(), {0.01, -0.05, 0.12}};
  const std::string resting = dvrk_base_frame_json(base, "camera"), held = dvrk_suj_fixed_json(base, "PSM2", ecm);
  EXPECT_NE(resting.find("\"base_frame\": {"), std::string::npos) << resting;
  EXPECT_NE(resting.find("\"reference_frame\": \"camera\""), std::string::npos) << resting;
  EXPECT_NE(held.find("\"name\": \"PSM2\""), std::string::npos) << held;
  Eigen::Matrix4d ecm_from_camera = Eigen::Matrix4d::Identity();
  ecm_from_camera.topLeftCorner<3, 3>() = ecm.rotation.toRotationMatrix();
  ecm_from_camera.topRightCorner<3, 1>() = ecm.translation;
  const Eigen::Matrix4d by_suj = ecm_from_camera.inverse() * matrix_after(held, "measured_cp");
  EXPECT_LT((by_suj - matrix_after(resting, "transform")).norm(), 1e-9);
  EXPECT_LT((matrix_after(resting, "transform").row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm(), 1e-12);
}

}  // namespace lapservo::internal::dvrk_frames_test
