#include "lapservo/control/frozen_image.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr double frame_s = 1.0 / 30;

ImageMeasurement image_at(double time_s, const Eigen::Vector4d& features) {
  ImageMeasurement image;
  image.found = true;
  image.time_s = time_s;
  image.features = features;
  return image;
}

const Eigen::Vector4d f(0.9, 400, 180, 100);

// Joints with this velocity from `start_s` on, up to 5 s.
JointHistory moving(const Eigen::Vector4d& velocity, double start_s = 0) {
  JointHistory history;
  for (int k = 0; k <= 300; ++k) history.push(k / 60.0, velocity * std::max(0.0, k / 60.0 - start_s));
  return history;
}

TEST(FrozenImage, TellsAPictureThatRepeatsWhileTheArmMoves) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0.05, 0, 0, 0});
  EXPECT_FALSE(frozen.add(image_at(3, f), history));
  EXPECT_TRUE(frozen.add(image_at(3 + frame_s, f), history));
  EXPECT_TRUE(frozen.add(image_at(3 + 2 * frame_s, f + Eigen::Vector4d(5e-5, 0.01, 0, 0)), history));
  EXPECT_FALSE(frozen.add(image_at(3 + 3 * frame_s, f + Eigen::Vector4d(0, 1, 0, 0)), history));  // it goes on
}

// Longer than any history reaches back, the arm standing after it has moved.
TEST(FrozenImage, StaysFrozenHoweverLong) {
  FrozenImage frozen{Scales()};
  JointHistory history = moving({0.05, 0, 0, 0});
  EXPECT_FALSE(frozen.add(image_at(3, f), history));
  EXPECT_TRUE(frozen.add(image_at(4, f), history));
  for (int k = 0; k < 2000; ++k) history.push(5.1 + 0.02 * k, Eigen::Vector4d(0.25, 0, 0, 0));
  ASSERT_GT(history.oldest_s(), 3);
  EXPECT_TRUE(frozen.add(image_at(45, f), history));
}

TEST(FrozenImage, NoisyPicturesOfAnArmThatStandsOrMovesAreNotFrozen) {
  Random random(1);
  for (const double speed : {0.0, 0.01, 0.3}) {
    FrozenImage frozen{Scales()};
    const JointHistory history = moving({speed, 0, 0, 0});
    for (int k = 0; k < 120; ++k) {
      const Eigen::Vector4d noise(1e-4 * random.normal(), 0.1 * random.normal(), 0.1 * random.normal(),
                                  0.1 * random.normal());
      const Eigen::Vector4d motion(0, 600 * speed * k * frame_s, 0, 0);
      EXPECT_FALSE(frozen.add(image_at(0.5 + k * frame_s, f + noise + motion), history)) << speed << ' ' << k;
    }
  }
}

// Without noise nothing changes until the delay has passed since the start.
TEST(FrozenImage, ACameraWithoutNoiseMayShowAnArmThatJustStarts) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0.1, 0.1, 0, 0}, 2);
  for (double time_s = 1; time_s < 2.29; time_s += frame_s)
    EXPECT_FALSE(frozen.add(image_at(time_s, f), history)) << time_s;
  EXPECT_TRUE(frozen.add(image_at(2.36, f), history));
}

TEST(FrozenImage, AJointMayCrossItsPlay) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0, 0, 1e-4, 0.02});
  for (double time_s = 1; time_s < 5; time_s += frame_s)
    EXPECT_FALSE(frozen.add(image_at(time_s, f), history)) << time_s;
}

}  // namespace
}  // namespace lapservo::internal
