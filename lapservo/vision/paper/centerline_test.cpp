#include "lapservo/vision/paper/centerline.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/shaft/rcm_prior.h"

namespace lapservo::internal::centerline_test {

using scenes::Shot;
using scenes::usual_shot;

// Where tau wraps, so does the cross-ratio: a pixel's noise may take the reading to the other end.
bool near_the_seam(const Shot& shot) {
  return std::abs(wrap_pi(shot.line().tau_rad)) < 0.5;
}

TEST(Centerline, FindsTheBoundariesToThePixelAndTauToItsSigma) {
  double squares = 0;
  int count = 0;
  scenes::for_each_shot(16, [&](const Shot& shot) {
    if (near_the_seam(shot)) return;
    const Observation o = CenterlineMethod(shot.rig).observe(shot.bgr)[0];
    ASSERT_EQ(o.status, Status::ok);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_LT((o.edges_ideal_px[k] - shot.line().ideal_px[k]).norm(), 3.5) << k;
    const double sigmas = wrap_pi(o.tau_rad - shot.line().tau_rad) / o.sigma_tau_rad;
    EXPECT_LT(std::abs(sigmas), 5);
    squares += sigmas * sigmas;
    ++count;
    ASSERT_TRUE(o.rcm);
    EXPECT_NEAR(wrap_pi(o.rcm->q.theta_rad - shot.q.theta_rad), 0, 0.02);
    EXPECT_NEAR(o.rcm->q.phi_rad, shot.q.phi_rad, 0.03);
    EXPECT_NEAR(o.rcm->q.rho_m, shot.q.rho_m, 2e-3);
    EXPECT_LT(std::abs(shot.psi_error_rad(o.rcm->q.psi_rad)), 5 * std::sqrt(o.rcm->covariance(3, 3)));
  });
  ASSERT_GE(count, 10);
  EXPECT_LT(std::sqrt(squares / count), 2);
  EXPECT_GT(std::sqrt(squares / count), 0.3);
}

TEST(Centerline, TellsWhatItsRegistrationIsOffBy) {
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  int count = 0;
  Random random(7);
  scenes::for_each_shot(16, [&](const Shot& shot) {
    if (near_the_seam(shot)) return;
    Rig rig = shot.rig;
    scenes::misregister(rig.instruments[0], 1e-3, 5e-3, random);
    const Observation o = CenterlineMethod(rig).observe(shot.bgr)[0];
    ASSERT_TRUE(o.rcm);
    squares += configuration_change(shot.q, o.rcm->q).cwiseAbs2().cwiseQuotient(o.rcm->covariance.diagonal());
    ++count;
  });
  const Eigen::Vector4d off_by_sigma = (squares / count).cwiseSqrt();
  EXPECT_LT(off_by_sigma.maxCoeff(), 1.6) << off_by_sigma.transpose();
  EXPECT_GT(off_by_sigma.minCoeff(), 0.4) << off_by_sigma.transpose();
}

TEST(Centerline, WithoutTheRcmTellsTauAlone) {
  const Shot& shot = usual_shot(2);
  const Observation with = CenterlineMethod(shot.rig).observe(shot.bgr)[0],
                    without = CenterlineMethod(scenes::without_rcm(shot.rig)).observe(shot.bgr)[0];
  ASSERT_EQ(without.status, Status::ok);
  EXPECT_FALSE(without.rcm);
  EXPECT_FALSE(without.features.r_px);
  EXPECT_EQ(without.tau_rad, with.tau_rad);
}

TEST(Centerline, KnowsInstrumentsByTheirOrderOfColours) {
  const Shot& shot = usual_shot(2);
  const auto observations = CenterlineMethod(scenes::usual_rig(3)).observe(shot.bgr);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(observations[i].status == Status::ok, i == 0) << i;
}

}  // namespace lapservo::internal::centerline_test
