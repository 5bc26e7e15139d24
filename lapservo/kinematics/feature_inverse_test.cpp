#include "lapservo/kinematics/feature_inverse.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/test_models.h"
#include "lapservo/testing/rigs.h"

namespace lapservo {
namespace {

double apart(const RcmCoordinates& a, const RcmCoordinates& b) {
  return (equivalent_nearest(a, b).vector() - b.vector()).norm();
}

// The working region that the paper's trajectory needs on configs/paper.yaml; psi may lie anywhere within a turn.
const RcmLimits paper_region{{-0.04, 1.51, 0.058, -pi}, {0.18, 1.63, 0.070, pi}};

TEST(FeatureInverse, FindsTheConfiguration) {
  constexpr std::uint64_t seed = 41;
  Random random(seed);
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 300; ++trial) {
      const RcmCoordinates q = testing::visible_configuration(model, random);
      const auto found = inverse_feature_map(model, feature_map(model, q).point->f);
      const bool hit =
          std::any_of(found.begin(), found.end(), [&](const RcmCoordinates& other) { return apart(other, q) < 1e-5; });
      EXPECT_TRUE(hit) << "seed " << seed << ", trial " << trial << ", q " << q.vector().transpose() << ", found "
                       << found.size();
    }
}

TEST(FeatureInverse, EverythingFoundShowsTheFeatures) {
  constexpr std::uint64_t seed = 42;
  Random random(seed);
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 100; ++trial) {
      const Eigen::Vector4d f = feature_map(model, testing::visible_configuration(model, random)).point->f;
      const auto found = inverse_feature_map(model, f);
      EXPECT_LE(found.size(), 8u);
      for (const RcmCoordinates& q : found) {
        const Eigen::Vector4d again = feature_map(model, q).point->f;
        EXPECT_NEAR(wrap_pi(again[0] - f[0]), 0, 1e-7) << "seed " << seed;
        EXPECT_LT((again - f).tail<3>().norm(), 1e-4) << "seed " << seed;
      }
    }
}

// Completeness by another route: Newton's method from many starts never ends in a solution that was not listed.
TEST(FeatureInverse, MissesNoSolution) {
  constexpr std::uint64_t seed = 43;
  Random random(seed);
  int ended = 0;
  for (const ImageModel& model : testing::image_models())
    for (int trial = 0; trial < 15; ++trial) {
      const Eigen::Vector4d f = feature_map(model, testing::visible_configuration(model, random)).point->f;
      const auto found = inverse_feature_map(model, f);
      for (int start = 0; start < 15; ++start) {
        Eigen::Vector4d x = testing::visible_configuration(model, random).vector();
        Eigen::Vector4d error = Eigen::Vector4d::Constant(1e9);
        for (int step = 0; step < 60; ++step) {
          const auto at = feature_map(model, RcmCoordinates::from_vector(x));
          if (!at.point) break;
          error = at.point->f - f;
          error[0] = wrap_pi(error[0]);
          x -= 0.5 * at.point->jacobian.fullPivLu().solve(error);
        }
        if (!(error.norm() < 1e-6) || !(x[2] > 0)) continue;
        ++ended;
        const RcmCoordinates q = RcmCoordinates::from_vector(x);
        EXPECT_TRUE(
            std::any_of(found.begin(), found.end(), [&](const RcmCoordinates& o) { return apart(o, q) < 1e-3; }))
            << "seed " << seed << ", q " << x.transpose();
      }
    }
  EXPECT_GT(ended, 100);
}

TEST(FeatureInverse, IsUniqueInThePapersWorkingRegion) {
  constexpr std::uint64_t seed = 44;
  Random random(seed);
  const auto models = testing::image_models();
  const ImageModel& model = models.front();
  for (int trial = 0; trial < 2000; ++trial) {
    const RcmCoordinates q{random.uniform(-0.04, 0.18), random.uniform(1.51, 1.63), random.uniform(0.058, 0.07),
                           random.uniform(-pi, pi)};
    const auto result = feature_map(model, q);
    ASSERT_TRUE(result.point);
    const InverseResult inverse = inverse_within(model, result.point->f, paper_region, {0.07, 1.57, 0.064, 0});
    ASSERT_EQ(inverse.status, InverseStatus::ok) << "seed " << seed << ", q " << q.vector().transpose();
    EXPECT_LT(apart(inverse.q, q), 1e-6) << "seed " << seed;
  }
}

ImageModel paper_rig() {
  const Rig rig = testing::paper_test_rig();
  return {rig.camera, rig.instruments.front().marker, rig.instruments.front().camera_from_rcm.value()};
}

// The stated bounds are rounded to the last digit.
const RcmLimits paper_region_rounded{{-0.045, 1.505, 0.0575, -two_pi}, {0.185, 1.635, 0.0705, two_pi}};

// Section V-D's features: r 795 +- 60 px, l 365 +- 30 px, d 212 +- 37 px, s 0.9 +- 0.05 rad, moving in phase.
TEST(FeatureInverse, ReachesThePapersTrajectory) {
  const ImageModel model = paper_rig();
  RcmCoordinates reference{0.07, 1.57, 0.064, 0};
  double lowest_psi = 1e9, highest_psi = -1e9;
  constexpr int steps = 200;
  for (int i = 0; i <= steps; ++i) {
    const double swing = std::sin(two_pi * i / steps);
    const Eigen::Vector4d f(0.9 + 0.05 * swing, 795 + 60 * swing, 365 + 30 * swing, 212 + 37 * swing);
    const InverseResult inverse = inverse_within(model, f, paper_region_rounded, reference);
    ASSERT_EQ(inverse.status, InverseStatus::ok) << "f " << f.transpose() << ", q " << inverse.q.vector().transpose();
    if (i > 0) {
      EXPECT_LT((inverse.q.vector() - reference.vector()).norm(), 0.05) << "jumps at step " << i;
    }
    reference = inverse.q;
    lowest_psi = std::min(lowest_psi, inverse.q.psi_rad);
    highest_psi = std::max(highest_psi, inverse.q.psi_rad);
  }
  EXPECT_LT(highest_psi - lowest_psi, 1.45);
}

// Not only in phase: every corner of the box that the features span lies in the region.
TEST(FeatureInverse, ReachesEveryCornerOfThePapersTrajectory) {
  const ImageModel model = paper_rig();
  for (int corner = 0; corner < 16; ++corner) {
    const auto side = [&](int bit) { return (corner >> bit & 1) != 0 ? 1.0 : -1.0; };
    const Eigen::Vector4d f(0.9 + 0.05 * side(0), 795 + 60 * side(1), 365 + 30 * side(2), 212 + 37 * side(3));
    const InverseResult inverse = inverse_within(model, f, paper_region_rounded, {0.07, 1.57, 0.064, 1});
    EXPECT_EQ(inverse.status, InverseStatus::ok) << "f " << f.transpose() << ", q " << inverse.q.vector().transpose();
  }
}

TEST(FeatureInverse, TestModelIsThePapersRig) {
  const ImageModel rig = paper_rig(), model = testing::image_models().front();
  const RcmCoordinates q{0.07, 1.57, 0.064, -2};
  EXPECT_LT((feature_map(rig, q).point->f - feature_map(model, q).point->f).norm(), 1e-6);
}

TEST(FeatureInverse, SaysWhyThereIsNone) {
  const auto models = testing::image_models();
  const ImageModel& model = models.front();
  const RcmCoordinates reference{0.07, 1.57, 0.064, 0};
  EXPECT_EQ(inverse_within(model, {0.9, 795, 365, 364}, paper_region, reference).status, InverseStatus::unreachable);
  EXPECT_EQ(inverse_within(model, {0.9, 795, -1, 10}, paper_region, reference).status, InverseStatus::unreachable);
  EXPECT_EQ(
      inverse_within(model, {0.9, std::numeric_limits<double>::infinity(), 365, 212}, paper_region, reference).status,
      InverseStatus::unreachable);
  const Eigen::Vector4d far = feature_map(model, {0.5, 1.57, 0.08, 0}).point->f;
  EXPECT_EQ(inverse_within(model, far, paper_region, reference).status, InverseStatus::outside_limits);
}

TEST(FeatureInverse, WritesAConfigurationWithinReachOfTheReference) {
  const auto models = testing::image_models();
  constexpr std::uint64_t seed = 45;
  Random random(seed);
  for (const ImageModel& model : models)
    for (int trial = 0; trial < 50; ++trial) {
      const RcmCoordinates q = testing::visible_configuration(model, random);
      const RcmCoordinates reference{random.uniform(-7, 7), random.uniform(-3, 3), 0.06, random.uniform(-20, 20)};
      const RcmCoordinates near = equivalent_nearest(q, reference);
      EXPECT_LE(std::abs(near.psi_rad - reference.psi_rad), pi + 1e-9);
      EXPECT_LE(std::abs(near.theta_rad - reference.theta_rad), pi + 1e-9);
      EXPECT_LT((feature_map(model, near).point->f - feature_map(model, q).point->f).norm(), 1e-6) << "seed " << seed;
    }
}

}  // namespace
}  // namespace lapservo
