#include "lapservo/servo/offset_steps.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/minimum_jerk.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::offset_steps_test {

constexpr double period_s = 1 / 60.0, slow_period_s = 0.1;  // of most tests; the longest that the loop runs at

// Joints that swing, images whose stamps are off by up to `jitter_s`, and an offset that the caller adds to.
class Swing {
 public:
  explicit Swing(std::uint64_t seed, double jitter_s = 0.001, double every_s = period_s)
      : random_(seed), jitter_s_(jitter_s), every_s_(every_s) {}

  SeenOffset next(const Eigen::Vector3d& offset = Eigen::Vector3d::Zero(), double late_s = 0) {
    const double t = every_s_ * count_++;
    const Eigen::Vector3d shown = at(t + late_s + random_.uniform(-jitter_s_, jitter_s_));
    const Eigen::Vector3d noise(3e-5 * random_.normal(), 3e-5 * random_.normal(), 3e-6 * random_.normal());
    SeenOffset seen{t};
    seen.measured.head<3>() = at(t), seen.rate_per_s.head<3>() = (at(t) - at(t - every_s_)) / every_s_;
    seen.offset.head<3>() = shown - at(t) + noise + offset;
    return seen;
  }

 private:
  static Eigen::Vector3d at(double t) {
    return {0.3 * std::sin(1.3 * t), 0.2 * std::sin(0.9 * t + 1), 0.01 * std::sin(1.1 * t + 2)};
  }
  Random random_;
  double jitter_s_, every_s_;
  int count_ = 0;
};

// After 150 images in which the offset stood.
struct Watched {
  explicit Watched(std::uint64_t seed, double image_every_s = period_s)
      : every_s(image_every_s), swing(seed, 0.001, every_s) {
    expect_silent(150);
  }

  bool add(const Eigen::Vector3d& offset) { return steps.add(swing.next(offset), true); }
  void expect_silent(int images, const Eigen::Vector3d& offset = Eigen::Vector3d::Zero()) {
    for (int i = 0; i < images; ++i) EXPECT_FALSE(add(offset)) << i;
  }
  // The motion of the offset from rest, on a smooth way that takes `duration_s`, when the first image is reported.
  double told_after_mrad(double duration_s) {
    const Eigen::Vector3d way(0.3, -0.2, 0.015);
    for (int i = 0; i * every_s < duration_s; ++i) {
      const Eigen::Vector3d moved = MinimumJerk::position(i * every_s / duration_s) * way;
      if (add(moved)) return 1e3 * moved[0];
    }
    return 1e3 * way[0];
  }

  double every_s;
  Swing swing;
  OffsetSteps steps;
};

TEST(OffsetSteps, IsSilentWhileTheJointsSwing) {
  for (const double every_s : {period_s, slow_period_s})
    for (const double jitter_s : {0.0, 0.001, 0.004})
      for (std::uint64_t seed = 1; seed <= 5; ++seed) {
        Swing swing(seed, jitter_s, every_s);
        OffsetSteps steps;
        for (int i = 0; i < 600; ++i)
          EXPECT_EQ(steps.add(swing.next(), i > 60) && i > 20, false) << jitter_s << " " << seed << " " << i;
      }
}

// Its speed grows little from image to image: what it gained is not usual.
TEST(OffsetSteps, TellsAnOffsetThatGainsSpeedByAndBy) {
  for (const double every_s : {period_s, slow_period_s})
    for (const double duration_s : {0.6, 1.0, 2.0, 4.0})
      for (std::uint64_t seed = 1; seed <= 5; ++seed)
        EXPECT_LT(Watched(seed, every_s).told_after_mrad(duration_s), 20)
            << every_s << " " << duration_s << " " << seed;
}

// Nor is it when it is over and all begins anew.
TEST(OffsetSteps, LearnsNothingFromWhatMovedBeforeItIsTold) {
  Watched watched(8);
  const double first_mrad = watched.told_after_mrad(2);
  watched.steps.drop_latest();
  watched.expect_silent(60);
  EXPECT_LT(watched.told_after_mrad(2), 1.5 * first_mrad);
}

// A step as of an encoder or a belt; the same step in two joints is reported.
TEST(OffsetSteps, TakesAJointThatSlipsForThatJoints) {
  const auto told = [](const Eigen::Vector3d& way) {
    Watched watched(9);
    int count = 0;
    for (int i = 0; i < 60; ++i)
      count += watched.add(MinimumJerk::position(std::min(1.0, i / 30.0)) * way);  // in half a second
    return count;
  };
  EXPECT_LE(told({0.03, 0, 0}), 2);
  EXPECT_LE(told({0, -0.03, 0}), 2);
  EXPECT_GT(told({0.03, -0.03, 0}), 5);
}

TEST(OffsetSteps, TellsAJumpForATenthOfASecondOnly) {
  Watched watched(3);
  const Eigen::Vector3d elsewhere(0.004, -0.004, 0.001);
  EXPECT_TRUE(watched.add(elsewhere));
  for (int i = 0; i < 7; ++i) watched.add(elsewhere);
  watched.expect_silent(30, elsewhere);
}

// Where images came late before, one more is nothing new.
TEST(OffsetSteps, LearnsHowLateImagesCome) {
  Swing swing(5);
  OffsetSteps steps;
  for (int i = 0; i < 300; ++i) steps.add(swing.next(Eigen::Vector3d::Zero(), i % 7 == 0 ? 0.012 : 0), true);
  for (int i = 0; i < 300; ++i)
    EXPECT_FALSE(steps.add(swing.next(Eigen::Vector3d::Zero(), i % 7 == 0 ? 0.012 : 0), true)) << i;
}

// Joints at rest, then theta at 1.5 rad/s, and the images' measurement: in phi a fraction of theta's path, all as by a
// delay that is wrong by `delay_off_s`. Returns the number of images during the motion that are reported.
int told_of_a_start(double phi_of_path, double delay_off_s, bool delay_is_known) {
  constexpr double per_s = 1.5;
  Random random(7);
  OffsetSteps steps;
  int told = 0;
  for (int i = 0; i < 180; ++i) {
    const double moves_s = period_s * std::max(0, i - 120), before_s = period_s * std::max(0, i - 121);
    const double theta_rad = per_s * moves_s, rate_per_s = (theta_rad - per_s * before_s) / period_s;
    const Eigen::Vector3d noise(3e-5 * random.normal(), 3e-5 * random.normal(), 3e-6 * random.normal());
    SeenOffset seen{period_s * i};
    seen.measured[0] = theta_rad, seen.rate_per_s[0] = rate_per_s;
    seen.offset.head<3>() = noise + Eigen::Vector3d(-rate_per_s * delay_off_s, phi_of_path * theta_rad, 0);
    const bool unusual = steps.add(seen, delay_is_known);
    told += unusual && i > 120;
  }
  return told;
}

// A frame that is off turns theta's motion into some of phi's.
TEST(OffsetSteps, ExpectsSomeOfThePathOfARegistrationThatIsOff) {
  EXPECT_EQ(told_of_a_start(0.08, 0, true), 0);
  EXPECT_GT(told_of_a_start(0.3, 0, true), 0);
}

TEST(OffsetSteps, ExpectsADelayThatIsOffByAsMuchAsItMayBe) {
  EXPECT_EQ(told_of_a_start(0, 0.015, true), 0);
  EXPECT_EQ(told_of_a_start(0, 0.1, false), 0);
  EXPECT_GT(told_of_a_start(0, 0.3, true), 0);
}

TEST(OffsetSteps, IgnoresTimeThatGoesBackAndWhatWasInterrupted) {
  Swing swing(6);
  OffsetSteps steps;
  SeenOffset seen;
  for (int i = 0; i < 100; ++i) steps.add(seen = swing.next(), true);
  seen.stamp_s -= 0.02;
  seen.offset[0] += 1;
  EXPECT_FALSE(steps.add(seen, true));
  steps.interrupt();
  EXPECT_FALSE(steps.add(swing.next({0.1, 0.1, 0.01}), true));
}

}  // namespace lapservo::internal::offset_steps_test
