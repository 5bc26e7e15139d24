#include "lapservo/control/delay_estimator.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::delay_estimator_test {

/// Slow motion of all joints, as a trajectory or an approach makes it.
Eigen::Vector4d joints_at(double time_s) {
  return {0.05 * std::sin(0.7 * time_s), 1.57 + 0.04 * std::sin(0.5 * time_s + 1),
          0.064 + 0.003 * std::sin(0.6 * time_s), 0.5 * std::sin(0.4 * time_s)};
}

struct Scene {
  double delay_s = 0.1;
  double backlash_rad = 0;  ///< of psi
  double backlash_m = 0;    ///< of rho
  bool moving = true;
  double jitter_s = 0;                              ///< of the images' stamps, one standard deviation
  std::optional<Eigen::Vector4d> seen{};            ///< by another camera
  Eigen::Matrix4d wrong = Eigen::Matrix4d::Zero();  ///< of the joints' motion, as the image shows it beside the joints
};

DelayEstimator estimator_after(const Scene& scene, double duration_s, std::uint64_t seed) {
  Random random(seed);
  const Eigen::Vector4d offset(0.035, -0.035, 0.003, 0.035), noise(3e-4, 3e-4, 2e-4, 1e-3);
  DelayEstimator estimator;
  JointHistory history;
  const auto truth = [&](double t) { return scene.moving ? joints_at(t) : joints_at(0); };
  for (int k = 0; k < 60 * duration_s; ++k) {
    const double t = k / 60.0;
    Eigen::Vector4d measured = truth(t);
    for (int i = 0; i < 4; ++i) measured[i] += 1e-5 * random.normal();
    history.push(t, measured);
    Eigen::Vector4d seen = truth(t - scene.delay_s + scene.jitter_s * random.normal()) + offset;
    seen += scene.wrong * (seen - joints_at(0));
    if (scene.seen) seen = *scene.seen;
    const Eigen::Vector4d ahead = truth(t - scene.delay_s + 1e-3) - truth(t - scene.delay_s);
    seen[2] -= std::copysign(scene.backlash_m / 2, ahead[2]);
    seen[3] -= std::copysign(scene.backlash_rad / 2, ahead[3]);
    for (int i = 0; i < 4; ++i) seen[i] += noise[i] * random.normal();
    estimator.add(t, seen, noise.cwiseAbs2().asDiagonal(), history);
  }
  return estimator;
}

std::optional<DelayEstimate> estimate_after(const Scene& scene, double duration_s, std::uint64_t seed) {
  return estimator_after(scene, duration_s, seed).estimate();
}

TEST(DelayEstimator, FindsTheDelayWithinHalfAFrame) {
  std::uint64_t seed = 0;
  for (const double delay_s : {0.0, 0.017, 0.06, 0.08, 0.15, 0.2, 0.25}) {
    for (const double backlash : {0.0, 1.0}) {
      SCOPED_TRACE(++seed);
      const auto found = estimate_after({delay_s, 0.02 * backlash, 0.0002 * backlash, true, 0.003}, 20, seed);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->delay_s, delay_s, 0.5 / 60);
    }
  }
}

// Images of another arm, and those that are later than any delay that is looked for.
TEST(DelayEstimator, ImagesThatNoDelayExplainsContradictIt) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    EXPECT_TRUE(estimator_after({.seen = joints_at(0)}, 30, seed).is_contradicted());
    EXPECT_TRUE(estimator_after({.delay_s = 1.5}, 30, seed).is_contradicted());
    EXPECT_FALSE(
        estimator_after({.delay_s = 0.2, .backlash_rad = 0.03, .backlash_m = 2e-4}, 30, seed).is_contradicted());
    EXPECT_FALSE(estimator_after({.moving = false, .seen = joints_at(0)}, 30, seed).is_contradicted());
  }
}

// With each fault no delay that is found is off by more than its sigma says.
TEST(DelayEstimator, SigmaHoldsWhereNoDelayExplainsTheImages) {
  constexpr std::uint64_t runs = 5;
  const auto tell = [](const char* name, double size, const Scene& departed) {
    int given = 0, wrong = 0;
    double squares = 0;
    for (std::uint64_t seed = 1; seed <= runs; ++seed)
      for (const double duration_s : {6.0, 20.0}) {
        Scene scene = departed;
        scene.delay_s = 0.083 + 0.001 * static_cast<double>(seed);
        const auto found = estimate_after(scene, duration_s, seed);
        if (!found) continue;
        const double z = (found->delay_s - scene.delay_s) / found->sigma_s;
        squares += z * z, ++given, wrong += std::abs(z) > 4;
      }
    const double error = std::sqrt(squares / std::max(1, given));
    EXPECT_EQ(wrong, 0) << name << ' ' << size;
    EXPECT_LT(error, size > 0 ? 2.5 : 1.5) << name << ' ' << size << ": 1.4 where it shows, or is as small as noise";
    // The allowance for persistent misfit is a margin where noise is white.
    EXPECT_GE(error, size > 0 ? 0 : 0.1) << name;
    return given;
  };
  EXPECT_EQ(tell("clean", 0, {}), 2 * runs);
  for (const double part : {0.03, 0.1, 1.0}) {
    tell("backlash of roll", 0.1 * part, {.backlash_rad = 0.1 * part});
    for (const auto& [name, of, by] : {std::tuple("theta's scale", 0, 0),
                                       {"phi's scale", 1, 1},
                                       {"theta with phi", 0, 1},
                                       {"phi with theta", 1, 0}}) {
      Scene scene;
      scene.wrong(of, by) = 0.3 * part;
      tell(name, 0.3 * part, scene);
    }
  }
}

TEST(DelayEstimator, SaysNothingWithoutMotion) {
  Scene still;
  still.moving = false;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) EXPECT_FALSE(estimate_after(still, 10, seed)) << "seed " << seed;
  EXPECT_FALSE(DelayEstimator().estimate());
}

}  // namespace lapservo::internal::delay_estimator_test
