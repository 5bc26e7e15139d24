#include "lapservo/vision/observation.h"

#include <cmath>
#include <set>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::observation_test {

using scenes::Shot;
using scenes::usual_shot;

Observation observe(const Shot& shot, bool with_rcm) {
  return Tracker(with_rcm ? shot.rig : scenes::without_rcm(shot.rig)).track(shot.bgr)[0];
}

bool all_finite(const Observation& o) {
  bool finite = std::isfinite(o.tau_rad) && std::isfinite(o.sigma_tau_rad) && std::isfinite(o.psi_rad) &&
                o.camera_from_unrolled.translation.allFinite() && o.camera_from_unrolled.rotation.coeffs().allFinite();
  for (std::size_t k = 0; k < 4; ++k)
    finite = finite && o.edges_ideal_px[k].allFinite() && o.edges_raw_px[k].allFinite();
  if (o.rcm) finite = finite && o.rcm->q.vector().allFinite() && o.rcm->covariance.allFinite();
  return finite && (o.status != Status::ok || o.edges_covariance_px2.allFinite());
}

// Pose, centre line, edges, features and tau agree.
void expect_consistent(const Shot& shot, bool with_rcm) {
  const Observation o = observe(shot, with_rcm);
  ASSERT_EQ(o.status, Status::ok);
  const auto line = centre_line(shot.rig.camera, shot.rig.instruments[0].marker, o.camera_from_unrolled, o.psi_rad);
  ASSERT_TRUE(line);
  EXPECT_NEAR(wrap_pi(line->tau_rad - o.tau_rad), 0, 1e-9);
  EXPECT_GE(o.tau_rad, 0);
  EXPECT_LT(o.tau_rad, two_pi);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_LT((line->ideal_px[k] - o.edges_ideal_px[k]).norm(), 1e-9);
    EXPECT_LT((shot.rig.camera.raw_from_ideal(o.edges_ideal_px[k]) - o.edges_raw_px[k]).norm(), 1e-9);
  }
  const auto& e = o.edges_ideal_px;
  EXPECT_NEAR(o.features.l_px, (e[3] - e[0]).norm(), 1e-9);
  EXPECT_NEAR(o.features.d_px, (e[2] - e[0]).norm(), 1e-9);
  // A cross-ratio is the same in every perspective image: here that of the print at tau.
  EXPECT_NEAR(o.features.cross_ratio, cross_ratio_at(shot.rig.instruments[0].marker, o.tau_rad), 1e-9);
  EXPECT_EQ(o.features.r_px.has_value(), with_rcm);
  ASSERT_EQ(o.rcm.has_value(), with_rcm);
  if (!with_rcm) return;
  const ShaftPose pose = scenes::pose_of(shot.rig, 0, o.rcm->q);
  EXPECT_LT((pose.camera_from_unrolled.translation - o.camera_from_unrolled.translation).norm(), 1e-12);
  EXPECT_NEAR(wrap_pi(pose.psi_rad - o.psi_rad), 0, 1e-12);
  EXPECT_LT(std::abs(o.rcm->q.psi_rad), pi + 1e-12);
}

TEST(Observation, ItsPartsAgree) {
  Rig rig = scenes::usual_rig();
  rig.camera.distortion = {-0.2, 0.05, 0.0006, -0.0004, 0};
  const Shot distorted(1, {}, rig);
  for (const bool with_rcm : {true, false}) {
    SCOPED_TRACE(with_rcm ? "with the RCM" : "without");
    for (const Shot* shot : {&usual_shot(1), &usual_shot(2), &distorted}) expect_consistent(*shot, with_rcm);
  }
}

// The covariance of q carried through the centre line: against samples of q.
TEST(Observation, SigmasOfTauAndFeaturesAreThoseOfSampledConfigurations) {
  scenes::for_each_shot(3, [](const Shot& shot) {
    const Observation o = observe(shot, true);
    ASSERT_EQ(o.status, Status::ok);
    const Eigen::Matrix4d root = o.rcm->covariance.llt().matrixL();
    EXPECT_TRUE(o.rcm->covariance.isApprox(o.rcm->covariance.transpose()));
    const auto rcm_px = projected_rcm_px(shot.rig.camera, *shot.rig.instruments[0].camera_from_rcm);
    const auto vector = [&](const std::array<Eigen::Vector2d, 4>& edges_px) {
      const Features f = features_of(edges_px, rcm_px);
      return Eigen::Vector4d(f.s_rad, *f.r_px, f.l_px, f.d_px);
    };
    const Eigen::Matrix4d covariance = features_covariance(o.edges_ideal_px, o.edges_covariance_px2, rcm_px);
    Random random(shot.seed);
    constexpr int samples = 10000;
    double squares = 0;
    Eigen::Vector4d of_features = Eigen::Vector4d::Zero();
    for (int i = 0; i < samples; ++i) {
      const Eigen::Vector4d deviate(random.normal(), random.normal(), random.normal(), random.normal());
      const auto q = JointVector::from_vector(o.rcm->q.vector() + root * deviate);
      const ShaftPose pose = scenes::pose_of(shot.rig, 0, q);
      const auto line =
          centre_line(shot.rig.camera, shot.rig.instruments[0].marker, pose.camera_from_unrolled, pose.psi_rad);
      ASSERT_TRUE(line);
      squares += std::pow(wrap_pi(line->tau_rad - o.tau_rad), 2);
      Eigen::Vector4d moved = vector(line->ideal_px) - vector(o.edges_ideal_px);
      moved[0] = wrap_pi(moved[0]);
      of_features += moved.cwiseAbs2().cwiseQuotient(covariance.diagonal()) / samples;
    }
    EXPECT_NEAR(o.sigma_tau_rad, std::sqrt(squares / samples), 0.04 * o.sigma_tau_rad);
    EXPECT_TRUE(of_features.isApprox(Eigen::Vector4d::Ones(), 0.08)) << of_features.transpose();
  });
}

// Whatever is shown: a status, and nothing that is not a number.
TEST(Observation, IsFiniteForEveryStatus) {
  const Rig rig = scenes::usual_rig(3);
  Random random(1);
  const cv::Mat usual = scenes::render(rig, scenes::random_configurations(rig, random), 1);
  const cv::Size size = usual.size();
  std::vector<cv::Mat> images{cv::Mat::zeros(size, CV_8UC3), cv::Mat(size, CV_8UC3, cv::Scalar::all(255)),
                              cv::Mat(size, CV_8UC3, cv::Scalar(20, 200, 110)), usual};
  cv::Mat noise(size, CV_8UC3);
  for (int v = 0; v < size.height; ++v)
    for (int i = 0; i < 3 * size.width; ++i) noise.ptr(v)[i] = static_cast<std::uint8_t>(random.uniform(0, 256));
  images.push_back(noise);
  // Markers partly covered, from ever further on either side.
  for (int covered = 100; covered < size.width; covered += 250) {
    const cv::Rect left(0, 0, covered, size.height), right(covered, 0, size.width - covered, size.height),
        below(0, covered / 2, size.width, size.height - covered / 2);
    for (const cv::Rect& part : {left, right, below})
      images.push_back(usual.clone()), images.back()(part) = cv::Scalar(30, 30, 120);
  }
  for (const double sigma_px : {3.0, 6.0}) cv::GaussianBlur(usual, images.emplace_back(), {}, sigma_px);
  // Bands without a shaft: flat stripes of the colours.
  cv::Mat stripes = cv::Mat::zeros(size, CV_8UC3);
  stripes(cv::Rect(200, 200, 60, 80)) = cv::Scalar(20, 200, 110);
  stripes(cv::Rect(260, 200, 60, 80)) = cv::Scalar(200, 200, 20);
  stripes(cv::Rect(320, 200, 60, 80)) = cv::Scalar(200, 20, 110);
  images.push_back(stripes);
  std::set<Status> seen;
  for (const Method method : {Method::surface, Method::centerline}) {
    Tracker tracker(rig, {.method = method, .single = true});
    for (std::size_t i = 0; i < images.size(); ++i) {
      const auto& observations = tracker.track(images[i]);
      ASSERT_EQ(observations.size(), 3U);
      for (const Observation& o : observations) {
        EXPECT_TRUE(all_finite(o)) << "image " << i;
        seen.insert(o.status);
      }
    }
  }
  EXPECT_GE(seen.size(), 5U);
}

}  // namespace lapservo::internal::observation_test
