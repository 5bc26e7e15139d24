#include "lapservo/control/frozen_image.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::frozen_image_test {

constexpr double frame_s = 1.0 / 30;

ImageMeasurement image_at(double time_s, const Eigen::Vector4d& features) {
  ImageMeasurement image;
  image.found = true;
  image.time_s = time_s;
  image.features = features;
  return image;
}

const Eigen::Vector4d f(0.9, 400, 180, 100);

ImageMeasurement again(double time_s, Repetition repetition) {
  ImageMeasurement image = image_at(time_s, f);
  image.repetition = repetition;
  return image;
}

using Verdict = FrozenImage::Verdict;

// Joints with this velocity from `start_s` on, up to 5 s.
JointHistory moving(const Eigen::Vector4d& velocity, double start_s = 0) {
  JointHistory history;
  for (int k = 0; k <= 300; ++k) history.push(k / 60.0, velocity * std::max(0.0, k / 60.0 - start_s));
  return history;
}

TEST(FrozenImage, TellsAPictureThatRepeatsWhileTheArmMoves) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0.05, 0, 0, 0});
  EXPECT_EQ(frozen.add(image_at(3, f), history), Verdict::fresh);
  EXPECT_EQ(frozen.add(image_at(3 + frame_s, f), history), Verdict::again);
  EXPECT_EQ(frozen.add(image_at(3 + 3 * frame_s, f + Eigen::Vector4d(5e-5, 0.01, 0, 0)), history), Verdict::frozen);
  EXPECT_EQ(frozen.add(image_at(3 + 4 * frame_s, f + Eigen::Vector4d(0, 1, 0, 0)), history),
            Verdict::fresh);  // it goes on
}

// Longer than any history reaches back, the arm standing after it has moved.
TEST(FrozenImage, StaysFrozenHoweverLong) {
  FrozenImage frozen{Scales()};
  JointHistory history = moving({0.05, 0, 0, 0});
  EXPECT_EQ(frozen.add(image_at(3, f), history), Verdict::fresh);
  EXPECT_EQ(frozen.add(image_at(4, f), history), Verdict::frozen);
  for (int k = 0; k < 2000; ++k) history.push(5.1 + 0.02 * k, Eigen::Vector4d(0.25, 0, 0, 0));
  ASSERT_GT(history.oldest_s(), 3);
  EXPECT_EQ(frozen.add(image_at(45, f), history), Verdict::frozen);
}

// As at the start of a run, before an arm at rest, and with a camera without noise: nothing changes until the delay has
// passed since the start, whether images began before the readings or afterwards.
TEST(FrozenImage, TellsAPictureThatStaysTheSameWhenTheArmStarts) {
  for (const double from_s : {-0.1, 1.0}) {
    FrozenImage frozen{Scales()};
    const JointHistory history = moving({0.1, 0, 0, 0}, 2);
    for (double time_s = from_s; time_s < 2.29; time_s += frame_s)
      EXPECT_EQ(frozen.add(image_at(time_s, f), history), Verdict::fresh) << time_s;
    EXPECT_EQ(frozen.add(image_at(2.36, f), history), Verdict::frozen);
  }
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
      EXPECT_EQ(frozen.add(image_at(0.5 + k * frame_s, f + noise + motion), history), Verdict::fresh)
          << speed << ' ' << k;
    }
  }
}

// Where the arm stands, too.
TEST(FrozenImage, NoiseNeverRepeats) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0, 0, 0, 0});
  EXPECT_EQ(frozen.add(again(3, Repetition::none), history), Verdict::fresh);
  EXPECT_EQ(frozen.add(again(3 + frame_s, Repetition::of_a_noisy_camera), history), Verdict::again);
  for (int k = 3; k < 50; ++k)
    EXPECT_EQ(frozen.add(again(3 + k * frame_s, Repetition::of_a_noisy_camera), history), Verdict::frozen) << k;
}

TEST(FrozenImage, AStreamThatShowsEachPictureSeveralTimesIsNotFrozen) {
  for (const int times : {2, 4, 6}) {  // 60 images a second of a camera of 30, 15 and 10
    FrozenImage frozen{Scales()};
    const JointHistory history = moving({0.05, 0, 0, 0});
    for (int k = 0; k < 60; ++k) {
      ImageMeasurement image = image_at(1 + k * frame_s / 2, f + Eigen::Vector4d(0, k / times, 0, 0));
      image.repetition = k % times == 0 ? Repetition::none : Repetition::of_a_noisy_camera;
      EXPECT_EQ(frozen.add(image, history), k % times == 0 ? Verdict::fresh : Verdict::again) << times << ' ' << k;
    }
  }
}

// A fifth of what features that stay ask for.
TEST(FrozenImage, ALittleMotionTellsWherePixelsAreTheSame) {
  for (const bool pixels : {true, false}) {
    FrozenImage frozen{Scales()};
    const JointHistory history = moving({2e-3, 0, 0, 0});
    const Repetition repetition = pixels ? Repetition::possible_at_rest : Repetition::none;
    EXPECT_EQ(frozen.add(again(3, Repetition::none), history), Verdict::fresh);
    EXPECT_EQ(frozen.add(again(3.12, repetition), history), pixels ? Verdict::frozen : Verdict::fresh);
  }
}

TEST(FrozenImage, AJointMayCrossItsPlay) {
  FrozenImage frozen{Scales()};
  const JointHistory history = moving({0, 0, 1e-4, 0.02});
  for (double time_s = 1; time_s < 5; time_s += frame_s)
    EXPECT_EQ(frozen.add(image_at(time_s, f), history), Verdict::fresh) << time_s;
}

}  // namespace lapservo::internal::frozen_image_test
