#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <gtest/gtest.h>

#include "lapservo/core/statistics.h"
#include "lapservo/testing/motion.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/edges/edge_blur.h"

namespace lapservo::internal::blurred_boundary_test {

using scenes::Shot;

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

// A lens's blur moves the inner boundaries of a shaft of 14 px of radius by up to 0.1 px, to the other side on the
// other half of the shaft.
TEST(BlurredBoundary, ALensLeavesNoLean) {
  Rig rig = scenes::usual_rig();
  rig.instruments[0].marker = scenes::scaled_to(rig.instruments[0].marker, 0.003);
  std::array<std::vector<double>, 2> residuals_px;  // of either half
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Shot shot(seed, {}, rig);
    const EdgeMeasurements edges = measure_edges(shot.sight.scene(), shot.sight.light(), shot.truth(true), film_mean_m,
                                                 {2, 0, 3, 1}, {0.96, 0.96});
    for (const Measurement& m : edges.all)
      if ((m.group == 1 || m.group == 2) && std::abs(m.across) > 0.5) {
        const double along_px = m.residual_px * (m.along_px_per_m > 0 ? 1 : -1);
        residuals_px[m.across > 0 ? 1 : 0].push_back(along_px);
      }
  }
  ASSERT_GT(residuals_px[0].size(), 50U);
  EXPECT_NEAR(median(residuals_px[0]), median(residuals_px[1]), 0.015);
}

// To an image of the marker's middle moving evenly by so many pixels along the shaft and across it.
FineFit fit_to_motion(const Shot& shot, const Eigen::Vector2d& along_and_across_px, const EdgeBlur& blur) {
  const scenes::Motion motion{.along_and_across_px = along_and_across_px};
  const scenes::Sight sight(shot.rig, scenes::render_moving(shot.rig, shot.q, motion));
  return fit_finely(sight.scene(), sight.light(), shot.truth(true), {.blur = blur});
}

// Psi's other error (the film's thickness) is alike for two motions that are mirrored at the shaft: only what the fit
// makes of their direction separates them.
TEST(BlurredBoundary, PsiDoesNotFollowMotionObliqueToTheShaft) {
  constexpr int shots = 3;
  double apart_rad = 0;
  scenes::for_each_shot(shots, [&](const Shot& shot) {
    for (const double across_px : {-6.0, 6.0}) {
      SCOPED_TRACE(across_px);
      const FineFit fit = fit_to_motion(shot, {6, across_px}, {2, 2});
      ASSERT_TRUE(fit.converged);
      EXPECT_GT(fit.blur.correlation * across_px, 0.7 * 6);
      EXPECT_LT(std::abs(shot.psi_error_rad(fit.unknowns.pose().psi_rad)), 2.5 * std::sqrt(fit.psi_variance_rad2()));
      apart_rad += (across_px > 0 ? 1 : -1) * shot.psi_error_rad(fit.unknowns.pose().psi_rad) / shots;
    }
  });
  EXPECT_LT(std::abs(apart_rad), 0.004);
}

// Neither surer than they are nor less sure by far.
TEST(BlurredBoundary, FitsToMotionKnowHowSureTheyAre) {
  constexpr int shots = 4;
  double squares = 0;
  scenes::for_each_shot(shots, [&](const Shot& shot) {
    for (const double across_px : {-5.0, 5.0}) {
      const FineFit fit = fit_to_motion(shot, {7, across_px}, {1.2, 1.2});
      EXPECT_TRUE(fit.converged);
      const double error_rad = shot.psi_error_rad(fit.unknowns.pose().psi_rad);
      squares += error_rad * error_rad / fit.psi_variance_rad2() / (2 * shots);
    }
  });
  EXPECT_GT(std::sqrt(squares), 0.4);
  EXPECT_LT(std::sqrt(squares), 1.5);
}

}  // namespace lapservo::internal::blurred_boundary_test
