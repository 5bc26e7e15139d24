#include "lapservo/loop_topics/frame_topics.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/crtk/test_transport.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::frame_topics_test {

const JointVector there{0.05, 1.57, 0.064, 1.2};

Observation seen_at(const JointVector& q) {
  Observation seen;
  seen.status = Status::ok;
  seen.rcm = Observation::Rcm{q, Eigen::Vector4d(1e-6, 2e-6, 1e-8, 4e-6).asDiagonal()};
  return seen;
}

// Camera to RCM, turned by the joints, is camera to shaft; the marker begins rho along the shaft, turned by its seam.
TEST(FrameTopics, TheirChainsAreTheRigsKinematics) {
  Rig rig = testing::small_test_rig();
  rig.instruments[0].marker.seam_rad = 0.3;
  TestTransport transport;
  FrameTopics topics(transport, rig, {"camera", "rcm_of_NAME", "NAME", "shaft"});
  topics.publish(0, seen_at(there), rig.instruments[0].camera_from_rcm, 5);
  const auto resting = transport.sent<StaticTransformsMessage>("/tf_static");
  const auto moving = transport.sent<TransformsMessage>("/tf");
  ASSERT_EQ(resting.size(), 1u);
  ASSERT_EQ(moving.size(), 1u);
  ASSERT_EQ(moving[0].transforms.size(), 2u);
  EXPECT_EQ(moving[0].stamp_s, 5);
  const auto& rcm = resting[0].transforms.at(0);
  const auto& marker = moving[0].transforms[0];
  const auto& shaft = moving[0].transforms[1];
  EXPECT_EQ(rcm.child, "rcm_of_PSM1");
  EXPECT_EQ(marker.child, "PSM1");
  EXPECT_EQ(shaft.child, "shaft");
  for (const auto* one : {&rcm, &marker, &shaft}) EXPECT_EQ(one->frame, "camera");
  const Rigid3 rcm_from_shaft = rcm.frame_from_child.inverse() * shaft.frame_from_child;
  const Rigid3 shaft_from_marker = shaft.frame_from_child.inverse() * marker.frame_from_child;
  EXPECT_LT(rcm_from_shaft.translation.norm(), 1e-12);
  const Eigen::Quaterniond joints =
      rcm_from_unrolled(there).rotation * Eigen::AngleAxisd(there.psi_rad, Eigen::Vector3d::UnitZ());
  EXPECT_LT(joints.angularDistance(rcm_from_shaft.rotation), 1e-7);
  EXPECT_LT((shaft_from_marker.translation - Eigen::Vector3d(0, 0, there.rho_m)).norm(), 1e-12);
  const Eigen::Quaterniond seam(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  EXPECT_LT(seam.angularDistance(shaft_from_marker.rotation), 1e-7);
  EXPECT_EQ(transport.sent<PoseMessage>("/lapservo/PSM1/pose").at(0).frame, "camera");
}

TEST(FrameTopics, AnRcmThatMovesIsInEveryImageOfWhichItIsKnown) {
  const Rig rig = testing::small_test_rig();
  const auto& camera_from_rcm = rig.instruments[0].camera_from_rcm;
  TestTransport transport;
  FrameTopics topics(transport, rig, {}, true);
  topics.publish(0, seen_at(there), camera_from_rcm, 5);
  topics.publish(0, {}, camera_from_rcm, 6);
  topics.publish(0, {}, std::nullopt, 7);
  EXPECT_TRUE(transport.sent<StaticTransformsMessage>("/tf_static").empty());
  const auto sent = transport.sent<TransformsMessage>("/tf");
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0].transforms.size(), 3u);
  EXPECT_EQ(sent[1].transforms.size(), 1u);
  EXPECT_EQ(sent[1].stamp_s, 6);
  for (const TransformsMessage& frames : sent) {
    EXPECT_EQ(frames.transforms.at(0).child, "PSM1_rcm");
    EXPECT_EQ(frames.transforms.at(0).frame_from_child, *camera_from_rcm);
  }
}

// The bands lie end to end along the marker, in the print's colours, and the shaft ends where they begin.
TEST(FrameTopics, CylindersAreTheMarkerAndTheShaft) {
  const Rig rig = testing::small_test_rig();
  const Marker& marker = rig.instruments[0].marker;
  TestTransport transport;
  FrameTopics topics(transport, rig, {});
  topics.publish(0, seen_at(there), rig.instruments[0].camera_from_rcm, 5);
  const auto cylinders = transport.sent<CylindersMessage>("/lapservo/PSM1/markers").at(0).cylinders;
  const Rigid3 camera_from_marker = transport.sent<TransformsMessage>("/tf").at(0).transforms[0].frame_from_child;
  ASSERT_EQ(cylinders.size(), 4u);
  double at_m = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d centre = camera_from_marker.inverse() * cylinders[k].frame_from_centre.translation;
    EXPECT_NEAR(centre.z(), at_m + cylinders[k].length_m / 2, 1e-12);
    EXPECT_NEAR(centre.head<2>().norm(), 0, 1e-12);
    EXPECT_EQ(cylinders[k].diameter_m, marker.diameter_m);
    at_m += cylinders[k].length_m;
  }
  EXPECT_NEAR(at_m, marker.length_m(), 1e-12);
  EXPECT_GT(cylinders[0].rgba[1], cylinders[0].rgba[0]) << "hue 90 is green";
  const Eigen::Vector3d middle = camera_from_marker.inverse() * cylinders[3].frame_from_centre.translation;
  EXPECT_NEAR(middle.z(), -there.rho_m / 2, 1e-12);
  EXPECT_NEAR(cylinders[3].length_m, there.rho_m, 1e-12);
}

TEST(FrameTopics, WithoutARegistrationThereIsTheMarkerWithItsOwnCovariance) {
  Rig rig = testing::small_test_rig();
  rig.instruments[0].camera_from_rcm.reset();
  TestTransport transport;
  FrameTopics topics(transport, rig, {});
  Observation seen;
  topics.publish(0, seen, std::nullopt, 4);
  seen.status = Status::ok;
  const Eigen::Quaterniond turn = Eigen::Quaterniond(0.2, 0.4, -0.1, 0.3).normalized();
  seen.marker = Observation::MarkerPose{{turn, {0.01, 0.02, 0.1}}};
  for (int i = 0; i < 36; ++i) seen.marker->covariance(i % 6, i / 6) = i % 6 == i / 6 ? 10 + i : 1;
  topics.publish(0, seen, std::nullopt, 5);
  EXPECT_TRUE(transport.sent<StaticTransformsMessage>("/tf_static").empty());
  ASSERT_EQ(transport.sent<TransformsMessage>("/tf").size(), 1u);
  EXPECT_EQ(transport.sent<TransformsMessage>("/tf")[0].transforms.size(), 1u);
  const PoseMessage pose = transport.sent<PoseMessage>("/lapservo/PSM1/pose").at(0);
  const Eigen::Matrix<double, 6, 6> told = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(pose.covariance.data());
  EXPECT_EQ(told, seen.marker->covariance);
}

TEST(FrameTopics, TheTipHasAFrameAndAPose) {
  Rig rig = testing::small_test_rig();
  rig.instruments[0].tool.emplace();
  TestTransport transport;
  FrameTopics topics(transport, rig, {});
  Observation seen = seen_at(there);
  topics.publish(0, seen, rig.instruments[0].camera_from_rcm, 4);
  EXPECT_TRUE(transport.sent<PoseMessage>("/lapservo/PSM1/tip_cp").empty());
  const Rigid3 camera_from_tip{Eigen::Quaterniond(0.2, 0.4, -0.1, 0.3).normalized(), {0.01, 0.02, 0.1}};
  seen.tip = Observation::Tip{camera_from_tip, 1e-6 * Eigen::Matrix<double, 6, 6>::Identity()};
  topics.publish(0, seen, rig.instruments[0].camera_from_rcm, 5);
  const auto pose = transport.sent<PoseMessage>("/lapservo/PSM1/tip_cp").at(0);
  EXPECT_EQ(pose.stamp_s, 5);
  EXPECT_EQ(pose.frame, "endoscope");
  EXPECT_EQ(pose.position_m[1], 0.02);
  EXPECT_EQ(pose.covariance[35], 1e-6);
  const auto frame = transport.sent<TransformsMessage>("/tf").at(1).transforms.back();
  EXPECT_EQ(frame.child, "PSM1_tip");
  EXPECT_EQ(frame.frame_from_child, camera_from_tip);
}

TEST(FrameTopics, ThePosesCovarianceIsThatOfItsSamples) {
  const Instrument instrument = testing::small_test_rig().instruments.front();
  const Observation::Rcm seen{there, Eigen::Vector4d(1e-6, 2e-6, 1e-8, 4e-6).asDiagonal()};
  const PoseMessage mean = pose_message(instrument, seen);
  const auto rotation = [](const PoseMessage& pose) {
    return Eigen::Quaterniond(Eigen::Vector4d(pose.quaternion_xyzw.data()));
  };
  Random random(1);
  constexpr int count = 4000;
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (int k = 0; k < count; ++k) {
    Eigen::Vector4d q = seen.q.vector();
    for (int i = 0; i < 4; ++i) q[i] += std::sqrt(seen.covariance(i, i)) * random.normal();
    const PoseMessage pose = pose_message(instrument, {JointVector::from_vector(q), seen.covariance});
    const Eigen::AngleAxisd turn(rotation(pose) * rotation(mean).conjugate());
    Eigen::Matrix<double, 6, 1> error;
    for (int i = 0; i < 3; ++i)
      error[i] = pose.position_m[static_cast<std::size_t>(i)] - mean.position_m[static_cast<std::size_t>(i)];
    error.tail<3>() = turn.angle() * turn.axis();
    sum += error * error.transpose() / count;
  }
  const Eigen::Matrix<double, 6, 6> told = Eigen::Map<const Eigen::Matrix<double, 6, 6>>(mean.covariance.data());
  for (const int part : {0, 3}) {
    const Eigen::Matrix3d expected = sum.block(part, part, 3, 3), got = told.block(part, part, 3, 3);
    EXPECT_LT((expected - got).norm(), 0.1 * got.norm()) << part;
  }
}

}  // namespace lapservo::internal::frame_topics_test
