#include "lapservo/control/backlash_estimator.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::backlash_estimator_test {

constexpr double period_s = 1.0 / 60;

/// Measured joints, and images of what the instrument does with them: backlash, offsets, and what else may be wrong.
struct World {
  Eigen::Vector4d backlash{0, 0, 1e-4, 0.02};
  Eigen::Vector4d noise{3e-4, 3e-4, 2e-5, 3e-3};
  Eigen::Matrix4d model_error = Eigen::Matrix4d::Zero();  ///< in joint scales
  double delay_error_s = 0;
  double bend = 0, wobble = 0;  ///< of the response to insertion and roll, and of what else moves them
  std::function<Eigen::Vector4d(double)> q_measured = [](double t) {
    return Eigen::Vector4d(0.05 * std::sin(0.7 * t), 0.03 * std::sin(0.5 * t), 0.006 * std::sin(two_pi / 10 * t),
                           0.7 * std::sin(two_pi / 12 * t + 1));
  };

  BacklashEstimator watched(double duration_s, std::uint64_t seed) const {
    const Scales scales;
    BacklashEstimator estimator({}, scales);
    Random random(seed);
    std::array<Backlash, 4> backlashes;
    for (int i = 0; i < 4; ++i) backlashes[static_cast<std::size_t>(i)] = Backlash(q_measured(0)[i]);
    for (double t = 0; t < duration_s; t += period_s) {
      const Eigen::Vector4d q = q_measured(t), then = q_measured(t - delay_error_s);
      Eigen::Vector4d seen(0.035, -0.035, 0.003, 0.035);
      for (int i = 0; i < 4; ++i) {
        Backlash& state = backlashes[static_cast<std::size_t>(i)];
        state.follow(then[i], backlash[i]);
        seen[i] += state.instrument(backlash[i]) + noise[i] * random.normal();
      }
      seen += scales.joints.cwiseProduct(model_error * then.cwiseQuotient(scales.joints));
      const Eigen::Vector4d size(0, 0, 2e-4, 0.04);
      seen +=
          bend * size.cwiseProduct((3 * then.cwiseQuotient(Eigen::Vector4d(1, 1, 0.006, 0.7))).array().sin().matrix());
      seen += wobble * size * std::sin(1.9 * t);
      estimator.follow(q);
      estimator.add(t, (q - q_measured(t - 0.05)) / 0.05, seen, noise.cwiseAbs2().asDiagonal());
    }
    return estimator;
  }
};

TEST(BacklashEstimator, IsSureOfNothingWithoutReversals) {
  World world;
  world.q_measured = [](double t) -> Eigen::Vector4d { return Eigen::Vector4d(0.01, 0.01, 0.001, 0.1) * t; };
  const BacklashEstimator estimator = world.watched(20, 3);
  for (const int i : {2, 3}) {
    const auto found = estimator.estimate(i);
    if (found) {
      EXPECT_GT(found->sigma, BacklashEstimatorConfig{}.largest[i]);
    }
  }
}

TEST(BacklashEstimator, IsNotFooledByAWrongDelayOrModel) {
  for (const double backlash : {0.0, 1.0}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      for (const double delay_error_s : {-0.008, 0.008}) {
        SCOPED_TRACE(std::to_string(backlash) + " seed " + std::to_string(seed));
        World world;
        world.backlash *= backlash;
        world.delay_error_s = delay_error_s;
        Random random(seed);
        for (int i = 0; i < 4; ++i)
          for (int k = 0; k < 4; ++k) world.model_error(i, k) = 0.15 * random.normal();
        const BacklashEstimator estimator = world.watched(40, seed);
        for (const int i : {2, 3}) {
          EXPECT_NEAR(estimator.estimate(i)->width, world.backlash[i], 0.06 * BacklashEstimatorConfig{}.largest[i]);
        }
      }
    }
  }
}

// With each fault no width that is sure enough to count is off by more than its sigma says.
TEST(BacklashEstimator, SigmaHoldsWhereNoBacklashExplainsTheImages) {
  const auto tell = [&](const char* name, double part, const std::function<void(World&, double)>& change) {
    int sure = 0, wrong = 0;
    double squares = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      World world;
      world.backlash *= 0.5 + 0.15 * static_cast<double>(seed);
      change(world, part);
      const BacklashEstimator estimator = world.watched(seed % 2 ? 20 : 40, seed);
      for (const int i : {2, 3}) {
        const auto found = estimator.estimate(i);
        if (!found || found->sigma > BacklashEstimatorConfig{}.max_sigma * BacklashEstimatorConfig{}.largest[i])
          continue;
        const double z = (found->width - world.backlash[i]) / found->sigma;
        ++sure, squares += z * z, wrong += std::abs(z) > 4;
      }
    }
    const double error = std::sqrt(squares / std::max(1, sure));
    EXPECT_EQ(wrong, 0) << name << ' ' << part;
    EXPECT_LT(error, 1.4) << name << ' ' << part;
    return sure;
  };
  EXPECT_EQ(tell("clean", 0, [](World&, double) {}), 20);
  for (const double part : {0.03, 0.1, 0.3, 1.0}) {
    tell("a wrong delay", part, [](World& world, double by) { world.delay_error_s = 0.02 * by; });
    tell("a wrong model", part, [](World& world, double by) {
      Random random(7);
      for (double& entry : world.model_error.reshaped()) entry = 0.3 * by * random.normal();
    });
    tell("a bent response", part, [](World& world, double by) { world.bend = by; });
    tell("a wobble", part, [](World& world, double by) { world.wobble = by; });
  }
}

TEST(BacklashEstimator, KeepsWhatItKnowsThroughAnInterruption) {
  const World world;
  BacklashEstimator estimator = world.watched(20, 1);
  const BacklashEstimate before = estimator.estimate(3).value();
  estimator.interrupt();
  for (double t = 20; t < 25; t += period_s) {
    const Eigen::Vector4d q = world.q_measured(t);
    estimator.follow(q);
    estimator.add(t, Eigen::Vector4d::Zero(), q + Eigen::Vector4d(0.3, 0.3, 0.01, 0.3),
                  world.noise.cwiseAbs2().asDiagonal());
  }
  const BacklashEstimate after = estimator.estimate(3).value();
  EXPECT_NEAR(after.width, before.width, 1e-3);
  EXPECT_LT(after.sigma, 1.5 * before.sigma);
}

}  // namespace lapservo::internal::backlash_estimator_test
