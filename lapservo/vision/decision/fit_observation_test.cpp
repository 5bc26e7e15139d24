#include "lapservo/vision/decision/fit_observation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::fit_observation_test {

using scenes::usual_shot;

Eigen::Vector3d column(const Rigid3& pose, int i) {
  return pose.rotation * Eigen::Vector3d::Unit(i);
}

// Errors drawn from the covariance, of the fit's unknowns, leave errors of the pose whose squares are as said.
TEST(MarkerPose, ErrorsAreAsItsSigmasSay) {
  constexpr int draws = 4000;
  const auto& shot = usual_shot(1);
  const Marker& marker = shot.rig.instruments[0].marker;
  const PoseUnknowns unknowns = shot.truth(true);
  Random random(71);
  PoseMatrix root = PoseMatrix::Zero();
  for (int i = 0; i < pose_unknowns; ++i)
    for (int k = 0; k <= i; ++k) root(i, k) = 1e-4 * random.normal();
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
    roll += std::pow(std::atan2(column(error, 0).y(), column(error, 0).x()), 2);
    Eigen::Matrix<double, 6, 1> all;
    all << moved, rotation_vector_of(is.rotation * said.camera_from_marker.rotation.conjugate());
    sum += all * all.transpose() / draws;
  }
  constexpr double tolerance = 0.05;  // 4000 draws leave 1 to 2 %
  const Eigen::Matrix<double, 6, 1> sigmas = said.covariance.diagonal().cwiseSqrt();
  const TipInMarker::Covariance beside =
      sigmas.cwiseInverse().asDiagonal() * (sum - said.covariance) * sigmas.cwiseInverse().asDiagonal();
  EXPECT_LT(beside.cwiseAbs().maxCoeff(), 2 * tolerance);
  for (const auto& [squares, sigma] : {std::pair(xy, said.sigma_xy_m), std::pair(z, said.sigma_z_m),
                                       std::pair(axis, said.sigma_axis_rad), std::pair(roll, said.sigma_roll_rad)})
    EXPECT_NEAR(std::sqrt(squares / draws) / sigma, 1, tolerance);
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

}  // namespace lapservo::internal::fit_observation_test
