#include "lapservo/vision/decision/fit_observation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

using scenes::usual_shot;

PoseMatrix random_covariance(double sigma, Random& random) {
  PoseMatrix root = PoseMatrix::Zero();
  for (int i = 0; i < pose_unknowns; ++i)
    for (int k = 0; k <= i; ++k) root(i, k) = sigma * random.normal();
  return root;
}

Eigen::Vector3d column(const Rigid3& pose, int i) {
  return pose.rotation * Eigen::Vector3d::Unit(i);
}

// Errors drawn from the covariance, of the fit's unknowns, leave errors of the pose whose squares are as said.
void expect_sigmas_of(const Marker& marker, const PoseUnknowns& unknowns, Random& random) {
  constexpr int draws = 4000;
  constexpr double sigma = 1e-4;
  const PoseMatrix root = random_covariance(sigma, random);
  const Observation::MarkerPose said = marker_pose_of(marker, unknowns, root * root.transpose());
  double xy = 0, z = 0, axis = 0, roll = 0;
  TipInMarker::Covariance sum = TipInMarker::Covariance::Zero();
  for (int draw = 0; draw < draws; ++draw) {
    PoseVector normal;
    for (double& number : normal) number = random.normal();
    const Rigid3 is = marker_pose_of(marker, unknowns.changed_by(root * normal), root).camera_from_marker;
    const Rigid3 error = said.camera_from_marker.inverse() * is;
    const Eigen::Vector3d moved = is.translation - said.camera_from_marker.translation;
    xy += moved.head<2>().squaredNorm() / 2, z += moved.z() * moved.z();
    axis += column(error, 2).head<2>().squaredNorm();
    Eigen::Matrix<double, 6, 1> all;
    all << moved, rotation_vector_of(is.rotation * said.camera_from_marker.rotation.conjugate());
    sum += all * all.transpose() / draws;
    roll += std::pow(std::atan2(column(error, 0).y(), column(error, 0).x()), 2);
  }
  constexpr double tolerance = 0.05;  // 4000 draws leave 1 to 2 %
  const Eigen::Matrix<double, 6, 1> sigmas = said.covariance.diagonal().cwiseSqrt();
  const TipInMarker::Covariance beside =
      sigmas.cwiseInverse().asDiagonal() * (sum - said.covariance) * sigmas.cwiseInverse().asDiagonal();
  EXPECT_LT(beside.cwiseAbs().maxCoeff(), 2 * tolerance);
  EXPECT_NEAR(std::sqrt(xy / draws) / said.sigma_xy_m, 1, tolerance);
  EXPECT_NEAR(std::sqrt(z / draws) / said.sigma_z_m, 1, tolerance);
  EXPECT_NEAR(std::sqrt(axis / draws) / said.sigma_axis_rad, 1, tolerance);
  EXPECT_NEAR(std::sqrt(roll / draws) / said.sigma_roll_rad, 1, tolerance);
}

TEST(MarkerPose, ErrorsAreAsItsSigmasSay) {
  const auto& shot = usual_shot(1);
  const Instrument& instrument = shot.rig.instruments[0];
  Random random(71);
  expect_sigmas_of(instrument.marker, shot.truth(true), random);
}

// Origin at the proximal end on the axis, z to the tip, x towards tau = 0, where the seam is.
TEST(MarkerPose, IsTheConventionsFrame) {
  const auto& shot = usual_shot(1);
  const Instrument& instrument = shot.rig.instruments[0];
  const PoseMatrix nothing = PoseMatrix::Zero();
  Marker marker = instrument.marker;
  const auto pose_at = [&](double psi_rad) {
    JointVector q = shot.q;
    q.psi_rad = psi_rad;
    const PoseUnknowns unknowns(pose_through_rcm(*instrument.camera_from_rcm, q), true);
    return marker_pose_of(marker, unknowns, nothing).camera_from_marker;
  };
  const Rigid3 camera_from_unrolled = *instrument.camera_from_rcm * rcm_from_unrolled(shot.q);
  marker.seam_rad = 0.7;
  EXPECT_TRUE(pose_at(-0.7).rotation.isApprox(camera_from_unrolled.rotation, 1e-9));
  EXPECT_TRUE(pose_at(-0.7).translation.isApprox(camera_from_unrolled.translation, 1e-12));
  EXPECT_NEAR(column(camera_from_unrolled, 1).dot(column(pose_at(pi / 2 - 0.7), 0)), 1, 1e-9);
}

TEST(MarkerPose, IsSeenWithAndWithoutTheRcm) {
  const auto& shot = usual_shot(1);
  for (const bool with_rcm : {true, false}) {
    Rig rig = shot.rig;
    const Instrument& instrument = shot.rig.instruments[0];
    if (!with_rcm) rig.instruments[0].camera_from_rcm.reset();
    const Observation seen = Tracker(rig).track(shot.bgr)[0];
    ASSERT_EQ(seen.status, Status::ok);
    ASSERT_TRUE(seen.marker);
    const Rigid3 truth = marker_pose_of(instrument.marker, shot.truth(true), PoseMatrix::Zero()).camera_from_marker;
    const Rigid3 error = truth.inverse() * seen.marker->camera_from_marker;
    constexpr double sigmas = 4;
    EXPECT_LT(column(error, 2).head<2>().norm(), sigmas * seen.marker->sigma_axis_rad);
    EXPECT_LT(std::abs(column(error, 0).y()), sigmas * seen.marker->sigma_roll_rad);
    const Eigen::Vector3d off = seen.marker->camera_from_marker.translation - truth.translation;
    EXPECT_LT(off.head<2>().cwiseAbs().maxCoeff(), sigmas * seen.marker->sigma_xy_m);
    EXPECT_LT(std::abs(off.z()), sigmas * seen.marker->sigma_z_m);
    EXPECT_LT(seen.marker->sigma_axis_rad, 0.02);
  }
}

}  // namespace
}  // namespace lapservo::internal
