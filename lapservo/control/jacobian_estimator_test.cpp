#include "lapservo/control/jacobian_estimator.h"

#include <gtest/gtest.h>

#include "lapservo/control/test_simulator.h"
#include "lapservo/control/tracking_law.h"

namespace lapservo::internal::jacobian_estimator_test {

using testing::TestRig;

/// Largest difference between two Jacobians, in scales, relative to the true one's size.
double relative_error(const Eigen::Matrix4d& found, const Eigen::Matrix4d& truth, const Scales& scales) {
  const auto scaled = [&](const Eigen::Matrix4d& j) -> Eigen::Matrix4d {
    return scales.features.cwiseInverse().asDiagonal() * j * scales.joints.asDiagonal();
  };
  return (scaled(found) - scaled(truth)).norm() / scaled(truth).norm();
}

ImageVector seen_at(const TestRig& rig, const Eigen::Vector4d& q) {
  const FeatureState state = exact_map(rig, q).value();
  ImageVector seen;
  seen << state.features, state.ends_px;
  return seen;
}

struct Probed {
  std::optional<ProbedModel> model;
  Eigen::Vector4d q_end;
};

Probed probe(const TestRig& rig, const Eigen::Vector4d& start, double delay_s, std::optional<double> known_delay_s,
             Random& random) {
  const Scales scales;
  const ProbingMotion motion({}, JointLimits{}, start);
  ProbingFit fit(scales, known_delay_s);
  JointHistory history;
  Eigen::Vector4d q = start;
  std::vector<Eigen::Vector4d> path;
  constexpr double tick_s = 1.0 / 600;
  for (int k = 0; k * tick_s < motion.duration_s(); ++k) {
    const double t = k * tick_s;
    path.push_back(q);
    history.push(t, q);
    if (k % 10 == 0) {
      const auto then = static_cast<std::size_t>(std::max(0.0, std::round((t - delay_s) / tick_s)));
      auto seen = seen_at(rig, path[then]);
      for (int i = 0; i < 8; ++i) seen[i] += (i == 0 ? 5e-4 : 0.15) * random.normal();
      fit.add(t, seen.head<4>(), seen.tail<4>(), history);
    }
    q += tick_s * motion.velocity(t + tick_s / 2);
  }
  return {fit.solve(), q};
}

TEST(ProbingMotion, ComesBackAndKeepsToItsDistance) {
  const ProbingConfig config;
  const JointLimits limits;
  const Eigen::Vector4d start(0.9, 0.7, 0.19, 0);
  const ProbingMotion motion(config, limits, start);
  Eigen::Vector4d q = start, low = start, high = start;
  constexpr double tick_s = 1e-3;
  for (double t = 0; t < motion.duration_s(); t += tick_s) {
    q += tick_s * motion.velocity(t + tick_s / 2);
    low = low.cwiseMin(q);
    high = high.cwiseMax(q);
    EXPECT_LE((motion.velocity(t).cwiseAbs() - limits.rate).maxCoeff(), 0);
    const Eigen::Vector4d acceleration = (motion.velocity(t + tick_s) - motion.velocity(t)) / tick_s;
    EXPECT_LE((acceleration.cwiseAbs() - limits.acceleration).maxCoeff(), 1e-3);
  }
  EXPECT_LT((q - start).norm(), 1e-4);
  EXPECT_TRUE((high - low).isApprox(config.distance, 1e-3));
  EXPECT_NEAR(high[0], start[0], 1e-4) << "moves away from the nearer limit";
  EXPECT_NEAR(low[1], start[1], 1e-4);
}

TEST(ProbingFit, FindsJacobianAndDelay) {
  const TestRig rig;
  const Scales scales;
  const ControllerConfig config = testing::test_config({});
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Eigen::Vector4d start = testing::random_start(rig, config, {}, random);
    const double delay_s = random.uniform(0.02, 0.25);
    const bool known = seed % 2 == 0;
    const auto probed = probe(rig, start, delay_s, known ? std::optional(delay_s) : std::nullopt, random);
    ASSERT_TRUE(probed.model);
    EXPECT_NEAR(probed.model->delay_s, delay_s, 0.5 / 60);
    const JacobianEstimator estimator({}, scales, *probed.model);
    const FeatureState truth = exact_map(rig, probed.q_end).value(), found = estimator.at(probed.q_end);
    EXPECT_LT(relative_error(found.jacobian, truth.jacobian, scales), 0.08);
    EXPECT_LT(relative_error(found.ends_jacobian, truth.ends_jacobian, {Eigen::Vector4d::Ones(), scales.joints}), 0.08);
    EXPECT_LT(feature_error(found.features, truth.features).cwiseQuotient(scales.features).norm(), 1);
  }
}

TEST(ProbingFit, SaysNothingWithoutMotion) {
  ProbingFit fit({}, 0.0);
  JointHistory history;
  for (int k = 0; k < 200; ++k) {
    history.push(k / 60.0, Eigen::Vector4d::Ones());
    fit.add(k / 60.0, Eigen::Vector4d::Ones(), Eigen::Vector4d::Ones(), history);
  }
  EXPECT_FALSE(fit.solve());
}

class JacobianEstimatorOnTheWay : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto probed = probe(rig, start, 0.08, 0.08, random);
    estimator.emplace(JacobianEstimatorConfig{}, scales, *probed.model);
    q = probed.q_end;
  }
  bool see(const Eigen::Vector4d& noise_scale = {5e-4, 0.15, 0.15, 0.15}) {
    auto seen = seen_at(rig, q);
    for (int i = 0; i < 4; ++i) seen[i] += noise_scale[i] * random.normal();
    return estimator->update(q, seen.head<4>(), seen.tail<4>(), 1.0 / 60);
  }

  TestRig rig;
  Scales scales;
  Random random{11};
  Eigen::Vector4d start{0.05, 1.57, 0.064, 1}, q;
  std::optional<JacobianEstimator> estimator;
};

/// One motion shows one direction: along it the Jacobian is learnt, in the others it stays as it was.
TEST_F(JacobianEstimatorOnTheWay, LearnsTheJacobianAlongTheMotion) {
  const Eigen::Matrix4d first = exact_map(rig, q)->jacobian;
  const Eigen::Vector4d from = q;
  double learnt = 0, frozen = 0;
  for (int k = 0; k <= 900; ++k) {
    const double t = k / 60.0;
    const Eigen::Vector4d before = q;
    q = from + Eigen::Vector4d(0.15 * std::sin(0.8 * t), 0.1 * std::sin(1.1 * t), 0.012 * std::sin(0.9 * t),
                               0.5 * std::sin(0.7 * t));
    ASSERT_TRUE(see()) << t;
    const Eigen::Matrix4d truth = exact_map(rig, q)->jacobian;
    const auto wrong_by = [&](const Eigen::Matrix4d& jacobian) {
      return ((jacobian - truth) * (q - before)).cwiseQuotient(scales.features).norm();
    };
    learnt += wrong_by(estimator->at(q).jacobian);
    frozen += wrong_by(first);
  }
  EXPECT_LT(learnt, 0.5 * frozen);
}

TEST_F(JacobianEstimatorOnTheWay, LearnsNoNoiseAtRest) {
  const Eigen::Matrix4d before = estimator->at(q).jacobian;
  for (int k = 0; k < 3600; ++k) see();
  EXPECT_LT(relative_error(estimator->at(q).jacobian, before, scales), 0.02);
}

TEST_F(JacobianEstimatorOnTheWay, IgnoresAnOutlierButBelievesAStep) {
  for (int k = 0; k < 10; ++k) see();
  const FeatureState before = estimator->at(q);
  const auto off_px = [&](double r_px) {
    return estimator->update(q, before.features + Eigen::Vector4d(0, r_px, 0, 0), before.ends_px, 1.0 / 60);
  };
  for (const double r_px : {50, -50, 60, -60, 70, -70}) EXPECT_FALSE(off_px(r_px)) << "no two of them agree";
  EXPECT_LT((estimator->at(q).features - before.features).norm(), 1e-9);
  for (int k = 0; k < 6; ++k) off_px(50);
  EXPECT_NEAR(estimator->at(q).features[1], before.features[1] + 50, 0.5);
  EXPECT_LT(relative_error(estimator->at(q).jacobian, before.jacobian, scales), 0.05) << "the Jacobian stays";
}

}  // namespace lapservo::internal::jacobian_estimator_test
