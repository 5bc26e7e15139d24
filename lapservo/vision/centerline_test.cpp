#include "lapservo/vision/centerline.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/features.h"
#include "lapservo/vision/theatre.h"

namespace lapservo {
namespace {

struct Shot {
  Rig rig = theatre::usual_rig();
  RcmCoordinates q;
  CentreLine line;
  cv::Mat image;

  explicit Shot(std::uint64_t seed) {
    Random random(seed);
    q = theatre::random_configuration(rig, 0, random);
    const ShaftPose pose = theatre::pose_of(rig, 0, q);
    line = centre_line(rig.camera, rig.instruments[0].marker, pose.camera_from_unrolled, pose.psi_rad).value();
    image = theatre::render(rig, {q}, seed);
  }
  // Where tau wraps, so does the cross-ratio: a pixel's noise may take the reading to the other end.
  bool near_the_seam() const { return std::abs(wrap_pi(line.tau_rad)) < 0.5; }
};

TEST(Centerline, FindsTheBoundariesToThePixelAndTauToItsSigma) {
  double squares = 0;
  int count = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Shot shot(seed);
    if (shot.near_the_seam()) continue;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Observation o = CenterlineMethod(shot.rig).observe(shot.image)[0];
    ASSERT_EQ(o.status, Status::ok);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_LT((o.edges_ideal_px[k] - shot.line.ideal_px[k]).norm(), 3.5) << k;
    const double sigmas = wrap_pi(o.tau_rad - shot.line.tau_rad) / o.sigma_tau_rad;
    EXPECT_LT(std::abs(sigmas), 5);
    squares += sigmas * sigmas;
    ++count;
    ASSERT_TRUE(o.rcm);
    EXPECT_NEAR(wrap_pi(o.rcm->q.theta_rad - shot.q.theta_rad), 0, 0.02);
    EXPECT_NEAR(o.rcm->q.phi_rad, shot.q.phi_rad, 0.03);
    EXPECT_NEAR(o.rcm->q.rho_m, shot.q.rho_m, 2e-3);
    EXPECT_LT(std::abs(wrap_pi(o.rcm->q.psi_rad - shot.q.psi_rad)), 5 * std::sqrt(o.rcm->covariance(3, 3)));
  }
  ASSERT_GE(count, 10);
  EXPECT_LT(std::sqrt(squares / count), 2);
  EXPECT_GT(std::sqrt(squares / count), 0.3);
}

TEST(Centerline, WithoutTheRcmTellsTauAlone) {
  const Shot shot(2);
  Rig rig = shot.rig;
  rig.instruments[0].camera_from_rcm.reset();
  const Observation with = CenterlineMethod(shot.rig).observe(shot.image)[0],
                    without = CenterlineMethod(rig).observe(shot.image)[0];
  ASSERT_EQ(without.status, Status::ok);
  EXPECT_FALSE(without.rcm);
  EXPECT_FALSE(without.features.r_px);
  EXPECT_EQ(without.tau_rad, with.tau_rad);
}

TEST(Centerline, KnowsInstrumentsByTheirOrderOfColours) {
  const Shot shot(2);
  Rig rig = theatre::usual_rig(3);
  const auto observations = CenterlineMethod(rig).observe(shot.image);
  EXPECT_EQ(observations[0].status, Status::ok);
  EXPECT_NE(observations[1].status, Status::ok);
  EXPECT_NE(observations[2].status, Status::ok);
}

TEST(Centerline, FindsNothingInTissue) {
  const Rig rig = theatre::usual_rig();
  for (const std::uint64_t seed : {1, 2, 3})
    EXPECT_NE(CenterlineMethod(rig).observe(theatre::render_nothing(rig, seed))[0].status, Status::ok) << seed;
}

}  // namespace
}  // namespace lapservo
