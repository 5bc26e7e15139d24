#include "lapservo/kinematics/feature_map.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/test_models.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::feature_map_test {

constexpr double step_by_joint[4] = {1e-6, 1e-6, 1e-7, 1e-6};

JointVector moved(const JointVector& q, Eigen::Index joint, double by) {
  Eigen::Vector4d x = q.vector();
  x[joint] += by;
  return JointVector::from_vector(x);
}

double from_seam(double tau_rad) {
  return std::abs(wrap_pi(tau_rad));
}

Eigen::Vector4d ends(const FeaturePoint& point) {
  return {point.ideal_px[0].x(), point.ideal_px[0].y(), point.ideal_px[3].x(), point.ideal_px[3].y()};
}

// The features' by central differences, row by row: a row has one unit, but for the lever of each joint; and the ends'.
void expect_jacobian(const ImageModel& model, const JointVector& q) {
  const auto point = feature_map(model, q);
  ASSERT_TRUE(point);
  const Eigen::Matrix4d& jacobian = point->jacobian;
  for (Eigen::Index joint = 0; joint < 4; ++joint) {
    const double h = step_by_joint[joint];
    const auto ahead = feature_map(model, moved(q, joint, h)), back = feature_map(model, moved(q, joint, -h));
    Eigen::Vector4d numeric = (ahead->f - back->f) / (2 * h);
    numeric[0] = wrap_pi(ahead->f[0] - back->f[0]) / (2 * h);
    const double lever_m = joint == 2 ? 1 : q.rho_m;
    for (Eigen::Index row = 0; row < 4; ++row) {
      const double scale =
          lever_m * jacobian.row(row).cwiseProduct(Eigen::RowVector4d(1 / q.rho_m, 1 / q.rho_m, 1, 1 / q.rho_m)).norm();
      EXPECT_NEAR(jacobian(row, joint), numeric[row], 1e-5 * std::max(std::abs(numeric[row]), 0.05 * scale))
          << "row " << row << ", joint " << joint << ", q " << q.vector().transpose();
    }
    const Eigen::Vector4d column = point->ends_jacobian.col(joint);
    EXPECT_LT((column - (ends(*ahead) - ends(*back)) / (2 * h)).norm(), 1e-5 * (1 + column.norm()))
        << "joint " << joint;
  }
}

TEST(FeatureMap, JacobianIsTheDerivative) {
  testing::SeededRandom random(31);
  int checked = 0;
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 400; ++trial) {
      const JointVector q = testing::visible_configuration(model, random);
      if (from_seam(feature_map(model, q)->tau_rad) < 1e-3) continue;
      SCOPED_TRACE(::testing::Message() << "trial " << trial);
      expect_jacobian(model, q);
      if (HasFailure()) return;
      ++checked;
    }
  EXPECT_GT(checked, 1000);
}

// At the seam only d jumps, by the step of the print there; on both sides the Jacobian is that side's derivative.
TEST(FeatureMap, JumpsInDAtTheSeamAndNowhereElse) {
  testing::SeededRandom random(34);
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 30; ++trial) {
      JointVector q = testing::visible_configuration(model, random);
      const double seam_psi_rad = q.psi_rad + feature_map(model, q)->tau_rad;  // tau = 0 there
      constexpr double beside = 1e-4;
      q.psi_rad = seam_psi_rad - beside;
      const FeaturePoint upper = *feature_map(model, q);  // tau = beside
      expect_jacobian(model, q);
      q.psi_rad = seam_psi_rad + beside;
      const FeaturePoint lower = *feature_map(model, q);  // tau = 2 pi - beside
      expect_jacobian(model, q);
      EXPECT_NEAR(upper.tau_rad, beside, 1e-9);
      EXPECT_NEAR(lower.tau_rad, two_pi - beside, 1e-9);
      EXPECT_LT((upper.f - lower.f).head<3>().norm(), 1e-9);
      const double jump_m = model.marker.bands_upper_m[2] - model.marker.bands_lower_m[2];
      EXPECT_GT((lower.f[3] - upper.f[3]) * jump_m, 0);
      EXPECT_LT((upper.jacobian - lower.jacobian).topRows<3>().norm(), 1e-6 * upper.jacobian.norm());
      if (HasFailure()) return;
    }
}

TEST(FeatureMap, IsAbsentWhereItIsUndefined) {
  const auto models = testing::image_models();
  const ImageModel& model = models.front();
  const JointVector q{0.05, 1.57, 0.065, -2};
  ASSERT_TRUE(feature_map(model, q));

  EXPECT_FALSE(feature_map(model, {NAN, 1.57, 0.065, 0}));
  const auto towards_camera = configuration_through(model.camera_from_rcm, {0, 0, 1e-4});
  EXPECT_FALSE(feature_map(model, *towards_camera)) << "the shaft holds the camera centre";
  ImageModel beside = model;
  beside.camera_from_rcm.translation.z() = 0;
  EXPECT_FALSE(feature_map(beside, q)) << "the RCM lies in the focal plane";
  EXPECT_FALSE(configuration_through(model.camera_from_rcm, model.camera_from_rcm.translation));
}

}  // namespace lapservo::internal::feature_map_test
