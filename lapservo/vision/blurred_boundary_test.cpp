#include "lapservo/vision/blurred_boundary.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

using scenes::Shot;
using scenes::usual_shot;

// Where a boundary appears on the line along the shaft, by blurring it numerically: light from each place beside it
// moves the boundary there, as it lies, and as bright as it is.
double blurred_place_px(const BoundaryCourse& course, const BlurEllipse& blur) {
  constexpr int half = 60;
  constexpr double reach_sigmas = 4;
  Eigen::Matrix2d covariance;
  covariance << blur.along_px2, blur.oblique_px2, blur.oblique_px2, blur.across_px2;
  const Eigen::Matrix2d root = covariance.llt().matrixL();
  double light = 0, place_px = 0;
  for (int i = -half; i <= half; ++i)
    for (int j = -half; j <= half; ++j) {
      const Eigen::Vector2d sigmas = reach_sigmas / half * Eigen::Vector2d(i, j), from_px = root * sigmas;
      const double weight = std::exp(-sigmas.squaredNorm() / 2) * (1 + course.light_change_per_px * from_px.y());
      const double boundary_px = course.slope * from_px.y() + 0.5 * course.curvature_per_px * from_px.y() * from_px.y();
      light += weight, place_px += weight * (boundary_px - from_px.x());
    }
  return place_px / light;
}

TEST(BlurredBoundary, LiesWhereItsBlurredPictureHasIt) {
  for (const BoundaryCourse& course : {BoundaryCourse{0.2, 0, 0.02}, BoundaryCourse{-0.3, 0.01, 0.03},
                                       BoundaryCourse{0, -0.02, 0}, BoundaryCourse{0.1, 0.01, -0.05}})
    for (const BlurEllipse& blur : {BlurEllipse{4, 4, 0}, BlurEllipse{9, 4, 4}, BlurEllipse{1, 9, -2}})
      EXPECT_NEAR(moved_by_blur_px(course, blur), blurred_place_px(course, blur), 0.005);
}

// An exposure during which the marker's middle moves evenly by so many pixels along the shaft and across it.
cv::Mat render_moving(const Shot& shot, const Eigen::Vector2d& along_and_across_px) {
  constexpr int moments = 9;
  const Instrument& instrument = shot.rig.instruments[0];
  const auto place_px = [&](const Eigen::Vector4d& q, double along_m) {
    return shot.rig.camera.raw_from_point(placement_of(instrument, JointVector::from_vector(q)).camera_from_unrolled *
                                          Eigen::Vector3d(0, 0, along_m));
  };
  const Eigen::Vector4d q = shot.q.vector();
  const double middle_m = instrument.marker.length_m() / 2;
  const Eigen::Vector2d along = (place_px(q, 2 * middle_m) - place_px(q, 0)).normalized();
  const Eigen::Vector2d motion_px =
      along_and_across_px.x() * along + along_and_across_px.y() * Eigen::Vector2d(-along.y(), along.x());
  Eigen::Matrix<double, 2, 3> px_per_step;
  const Eigen::Vector3d steps(1e-3, 1e-3, 1e-4);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d step = steps[i] * Eigen::Vector4d::Unit(i);
    px_per_step.col(i) = (place_px(q + step, middle_m) - place_px(q - step, middle_m)) / 2;
  }
  const Eigen::Vector3d steps_taken =
      px_per_step.transpose() * (px_per_step * px_per_step.transpose()).ldlt().solve(motion_px);
  Eigen::Vector4d motion = Eigen::Vector4d::Zero();
  motion.head<3>() = steps_taken.cwiseProduct(steps);
  Exposure exposure;
  for (int i = 0; i < moments; ++i)
    exposure.push_back({placement_of(instrument, JointVector::from_vector(q + ((i + 0.5) / moments - 0.5) * motion))});
  const cv::Mat tissue = make_tissue(shot.rig.camera.width_px, shot.rig.camera.height_px, 5);
  return Renderer(shot.rig.camera, {shaft_of(instrument)}, tissue).render_exposure(exposure, 1);
}

// What else psi is off by (the film's thickness) is alike for two motions that are mirrored at the shaft: only what the
// fit makes of their direction tells them apart.
TEST(BlurredBoundary, PsiDoesNotFollowMotionObliqueToTheShaft) {
  constexpr int shots = 3;
  double apart_rad = 0;
  for (std::uint64_t seed = 1; seed <= shots; ++seed)
    for (const double across_px : {-6.0, 6.0}) {
      const Shot& shot = usual_shot(seed);
      const scenes::Sight sight(shot.rig, render_moving(shot, {6, across_px}));
      const FineFit fit = fit_finely(sight.scene(), sight.light(), shot.truth(true), {2, 2});
      ASSERT_TRUE(fit.converged) << "seed " << seed << ", across " << across_px;
      EXPECT_GT(fit.blur.correlation * across_px, 0.7 * 6) << "seed " << seed;
      const double error_rad = wrap_pi(fit.unknowns.pose().psi_rad - shot.q.psi_rad);
      EXPECT_LT(error_rad * error_rad, 2.5 * 2.5 * fit.psi_variance) << "seed " << seed << ", across " << across_px;
      apart_rad += (across_px > 0 ? 1 : -1) * error_rad / shots;
    }
  EXPECT_LT(std::abs(apart_rad), 0.004);
}

}  // namespace
}  // namespace lapservo::internal
