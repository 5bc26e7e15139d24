#include "lapservo/vision/model/fine_fit.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lapservo/testing/shots.h"

namespace lapservo::internal::fine_fit_test {

using scenes::fit_from;
using scenes::Shot;

// As far off as a coarse fit may leave it: up to three pixels.
PoseVector random_offset(Random& random) {
  const auto within = [&](double reach) { return random.uniform(-reach, reach); };
  PoseVector offset;
  offset << within(0.01), within(0.01), within(0.15e-3), within(0.15e-3), within(0.3e-3), within(0.03);
  return offset;
}

// In units of what is left free: q through the RCM, else the pose. A mean of the numbers' squares.
double normalised_square(const Shot& shot, const FineFit& fit, const PoseUnknowns& from) {
  const PoseVector error = from.change_to(fit.unknowns);
  if (!fit.unknowns.through_rcm()) return error.dot(fit.covariance.ldlt().solve(error)) / pose_unknowns;
  const auto q =
      configuration_estimate(fit.unknowns, fit.covariance, *shot.sight.scene().registration, fit.with_registration);
  const Eigen::Vector4d off = configuration_change(scenes::q_of(shot.rig, from), q->q);
  return off.dot(q->covariance.ldlt().solve(off)) / 4;
}

// The sigmas include floors for what a renderer has none of (lens, print), so errors here stay somewhat below them.
void expect_honest(bool rcm) {
  SCOPED_TRACE(rcm ? "through the RCM" : "free");
  constexpr int frames = 48, bounded = 16;
  double squares = 0, psi_squares = 0, psi_sum = 0;
  int far = 0;
  scenes::for_each_shot(frames, [&](const Shot& shot) {
    Random random(shot.seed + 100);
    const PoseUnknowns truth = shot.truth(rcm);
    const FineFit fit = fit_from(shot, truth.changed_by(random_offset(random)));
    ASSERT_TRUE(fit.converged);
    const double psi_error_rad = truth.change_to(fit.unknowns)[psi_unknown];
    const double square = normalised_square(shot, fit, truth);
    EXPECT_LT(std::abs(psi_error_rad), 6e-3);
    if (shot.seed <= bounded) {
      EXPECT_LT(square, 4);
    }
    far += square > 4;
    squares += square;
    psi_squares += psi_error_rad * psi_error_rad / fit.psi_variance_rad2();
    psi_sum += psi_error_rad;
  });
  for (const double sum : {squares, psi_squares}) {
    EXPECT_GT(std::sqrt(sum / frames), 0.45);
    EXPECT_LT(std::sqrt(sum / frames), 1.2);
  }
  EXPECT_LE(far, 1) << "of chi^2 of four degrees of freedom three in a thousand";
  EXPECT_NEAR(psi_sum / frames, 0, 1.5e-3);
}
TEST(FineFit, ErrorsAreAsPredictedThroughTheRcmOrNot) {
  for (const bool rcm : {true, false}) expect_honest(rcm);
}

// Whichever side it comes from: Gauss-Newton with right derivatives ends at the same place.
TEST(FineFit, ForgetsItsStart) {
  scenes::for_each_shot(6, [](const Shot& shot) {
    for (const bool rcm : {true, false}) {
      SCOPED_TRACE(rcm ? "through the RCM" : "free");
      Random random(shot.seed + 200);
      const PoseUnknowns truth = shot.truth(rcm);
      const FineFit from_truth = fit_from(shot, truth);
      ASSERT_TRUE(from_truth.converged);
      const PoseVector offset = random_offset(random);
      for (const double side : {-1.0, 1.0}) {
        const FineFit fit = fit_from(shot, truth.changed_by(side * offset));
        ASSERT_TRUE(fit.converged);
        EXPECT_LT(normalised_square(shot, fit, from_truth.unknowns), 0.02);
      }
    }
  });
}

// The colours are looked up about where a boundary was found, on either side of where it was expected.
TEST(FineFit, FindsBackAlongTheShaftFromEitherSide) {
  scenes::for_each_shot(8, [](const Shot& shot) {
    const PoseUnknowns truth = shot.truth(true);
    const double px_per_m = shot.rig.camera.fx_px / truth.pose().camera_from_unrolled.translation.z();
    for (const double off_px : {-4.5, 4.5}) {
      const FineFit fit = fit_from(shot, truth.changed_by(off_px / px_per_m * PoseVector::Unit(4)));
      ASSERT_TRUE(fit.converged) << off_px;
      EXPECT_LT(normalised_square(shot, fit, truth), 4) << off_px;
    }
  });
}

TEST(FineFit, FindsTheBlurOfTheCamera) {
  for (const double blur_px : {0.8, 1.3, 1.8}) {
    const Shot shot(3, {.lighting = {}, .sensor = {.blur_px = blur_px}});
    const FineFit fit = fit_from(shot, shot.truth(true));
    ASSERT_TRUE(fit.converged) << blur_px;
    // A pixel's own area, and the interpolation between pixels, blur too.
    const double expected_px = std::sqrt(blur_px * blur_px + 1 / 12.0 + 1 / 6.0);
    EXPECT_NEAR(fit.blur.boundaries_px(), expected_px, 0.1) << blur_px;
    EXPECT_NEAR(fit.blur.sides_px, expected_px, 0.2) << blur_px;
  }
}

TEST(FineFit, SigmasGrowWithTheNoise) {
  const RenderOptions noisy{.lighting = {}, .sensor = {.read_noise = 12 * Sensor{}.read_noise}};
  scenes::for_each_shot(3, [&](const Shot& clear) {
    const Shot rough(clear.seed, noisy);
    const FineFit in_clear = fit_from(clear, clear.truth(true)), in_rough = fit_from(rough, rough.truth(true));
    ASSERT_TRUE(in_clear.converged && in_rough.converged);
    EXPECT_GT(in_rough.psi_variance_rad2(), 1.5 * in_clear.psi_variance_rad2());
  });
}

}  // namespace lapservo::internal::fine_fit_test
