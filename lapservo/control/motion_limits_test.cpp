#include "lapservo/control/motion_limits.h"

#include <algorithm>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal::motion_limits_test {

constexpr double period_s = 1.0 / 60;

Eigen::Vector4d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal(), random.normal()};
}

Eigen::Matrix4d random_matrix(Random& random) {
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 4; ++i) matrix.col(i) = random_vector(random);
  return matrix;
}

/// How far `state` lies beyond a joint limit or a rate limit, in fractions of the range.
double beyond(const JointLimits& limits, const MotionState& state) {
  const Eigen::Vector4d range = limits.upper - limits.lower;
  return std::max({(state.position - limits.upper).cwiseQuotient(range).maxCoeff(),
                   (limits.lower - state.position).cwiseQuotient(range).maxCoeff(),
                   (state.velocity.cwiseAbs() - limits.rate).cwiseQuotient(limits.rate).maxCoeff()});
}

/// End points as a linear function of the joints, so that the proof is exact.
struct LinearCamera {
  Eigen::Matrix4d jacobian;
  Eigen::Vector4d centre;
  EndPoints at(const Eigen::Vector4d& q) const {
    return {Eigen::Vector4d(500, 300, 700, 400) + jacobian * (q - centre), jacobian};
  }
};

TEST(MotionLimits, AreNeverCrossedWhateverIsWanted) {
  const JointLimits limits;
  const ImageWindow window{20, 1259, 20, 699};
  int touched_window = 0, touched_joints = 0, kept = 0;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    LinearCamera camera;
    camera.centre = (limits.lower + limits.upper) / 2;
    camera.jacobian = random_matrix(random) * Eigen::Vector4d(900, 900, 8000, 20).asDiagonal();
    JointPath path(limits.acceleration);
    path.reset(0, camera.centre);
    Eigen::Vector4d wanted = Eigen::Vector4d::Zero();
    Eigen::Matrix4d weight = Eigen::Matrix4d::Identity();
    VelocityRange range;
    for (int k = 0; k < 400; ++k) {
      if (k % 60 == 0) {
        wanted = random.uniform(0, 3) * random_vector(random).cwiseProduct(limits.rate);
        const Eigen::Matrix4d root = random_matrix(random);
        weight = root * root.transpose() + 0.01 * Eigen::Matrix4d::Identity();
      }
      const MotionState before = path.end();
      if (k % 30 == 0) range.upper = random_vector(random).cwiseProduct(limits.rate);
      range.lower = range.upper - 2 * limits.rate;
      const auto limited = [&](const VelocityRange& within) {
        return limit_velocity(limits, window, before, camera.at(before.position), wanted, weight, period_s, within);
      };
      const auto next = limited(range), freely = limited({});
      const Eigen::Vector4d braking = brake(limits, before.velocity, period_s), high = range.upper.cwiseMax(braking),
                            low = range.lower.cwiseMin(braking);
      ASSERT_LE((next.velocity - high).cwiseMax(low - next.velocity).maxCoeff(), 1e-9);
      if ((freely.velocity - range.upper).cwiseMax(range.lower - freely.velocity).maxCoeff() < 0) {
        ++kept;
        ASSERT_LE((next.velocity - freely.velocity).norm(), 1e-9);
      }
      const Eigen::Vector4d acceleration = (next.velocity - before.velocity) / period_s;
      ASSERT_LE((acceleration.cwiseAbs() - limits.acceleration).maxCoeff(), 1e-9);
      path.ramp_to(k * period_s, next.velocity, period_s);
      for (int part = 1; part <= 4; ++part) {
        const MotionState state = path.at((k + part / 4.0) * period_s);
        ASSERT_LE(beyond(limits, state), 1e-9);
        const Eigen::Vector4d ends = camera.at(state.position).ends_px;
        ASSERT_GE(ends.minCoeff(), 20 - 1e-6);
        ASSERT_LE(std::max(ends[0], ends[2]), 1259 + 1e-6);
        ASSERT_LE(std::max(ends[1], ends[3]), 699 + 1e-6);
        touched_window += std::max(ends[1], ends[3]) > 690 || ends.minCoeff() < 30 ? 1 : 0;
        touched_joints += beyond(limits, state) > -0.02 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(touched_window, 1000);
  EXPECT_GT(touched_joints, 1000);
  EXPECT_GT(kept, 1000);
}

TEST(MotionLimits, NameTheOneThatStopsTheArm) {
  const PositionBounds bounds(JointLimits(), ImageWindow{20, 1259, 20, 699});
  const auto stop = [&](const Eigen::Matrix<double, 8, 1>& place, const Eigen::Vector4d& wanted) {
    return stop_at(bounds, Scales(), place.head<4>(), {place.tail<4>(), Eigen::Matrix4d::Identity()}, wanted,
                   Eigen::Matrix4d::Identity());
  };
  for (Eigen::Index of = 0; of < 8; ++of)
    for (const bool upper : {false, true}) {
      Eigen::Matrix<double, 8, 1> place = (bounds.lower + bounds.upper) / 2;
      const Eigen::Vector4d outward = (upper ? 1 : -1) * Eigen::Vector4d::Unit(of % 4),
                            along = Eigen::Vector4d::Ones() - outward.cwiseAbs();
      EXPECT_FALSE(stop(place, outward).at);
      place[of] = upper ? bounds.upper[of] : bounds.lower[of];
      const Stop stopped = stop(place, outward + along);
      ASSERT_TRUE(stopped.at) << of;
      EXPECT_EQ(std::pair(stopped.at->of, stopped.at->upper), std::pair(of, upper));
      EXPECT_LT((stopped.left - along).norm(), 1e-12);
      EXPECT_FALSE(stop(place, along - outward).at) << of;
    }
  EXPECT_EQ(bounds.text({2, true}), "limits.upper rho_m 0.2");
  EXPECT_EQ(bounds.text({7, false}), "field of view: least e3_v_px 20");
}

TEST(MotionLimits, LetAnArmOutOfRangeComeBackOnly) {
  const JointLimits limits;
  MotionState motion{limits.upper + Eigen::Vector4d(0.1, 0.1, 0.01, 0.1), Eigen::Vector4d::Zero()};
  auto next = limit_velocity(limits, {}, motion, {}, limits.rate, Eigen::Matrix4d::Identity(), period_s);
  EXPECT_LE(next.velocity.maxCoeff(), 1e-12);
  EXPECT_TRUE(next.limited);
  for (int k = 0; k < 200; ++k) {
    next = limit_velocity(limits, {}, motion, {}, -limits.rate, Eigen::Matrix4d::Identity(), period_s);
    motion.position += period_s * (motion.velocity + next.velocity) / 2, motion.velocity = next.velocity;
  }
  EXPECT_LE(beyond(limits, motion), 1e-9);
}

TEST(MotionLimits, BrakingKeepsTheDirectionAndStops) {
  const JointLimits limits;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    Eigen::Vector4d velocity = random_vector(random).cwiseMax(-1).cwiseMin(1).cwiseProduct(limits.rate);
    const Eigen::Vector4d first = velocity;
    double time_s = 0;
    while (velocity.norm() > 0) {
      const Eigen::Vector4d next = brake(limits, velocity, period_s);
      EXPECT_LE(((next - velocity).cwiseAbs() / period_s - limits.acceleration).maxCoeff(), 1e-9);
      EXPECT_NEAR(next.dot(first), next.norm() * first.norm(), 1e-12);
      velocity = next;
      time_s += period_s;
    }
    EXPECT_LE(time_s, stopping_time_s(limits) + period_s + 1e-9);
  }
}

}  // namespace lapservo::internal::motion_limits_test
