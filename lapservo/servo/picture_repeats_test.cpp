#include "lapservo/servo/picture_repeats.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

namespace lapservo::internal::picture_repeats_test {

constexpr int width = 320, height = 180;

// A bar that moves from image to image before what stands still.
cv::Mat scene(int k) {
  cv::Mat picture(height, width, CV_8UC3, cv::Scalar(60, 70, 160));
  cv::rectangle(picture, {k % 40, 0, 60, height}, cv::Scalar(20, 180, 40), cv::FILLED);
  return picture;
}

cv::Mat noisy(cv::Mat picture, int seed) {
  cv::Mat noise(picture.size(), CV_8UC3);
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(noise, cv::RNG::UNIFORM, 0, 3);
  return picture + noise;
}

TEST(PictureRepeats, NoiseThatRepeatsIsTold) {
  PictureRepeats repeats;
  for (int k = 0; k < 12; ++k) EXPECT_EQ(repeats.add(noisy(scene(0), k)), Repetition::none) << k;
  EXPECT_EQ(repeats.add(noisy(scene(0), 11)), Repetition::of_a_noisy_camera);
  EXPECT_EQ(repeats.add(noisy(scene(0), 11)), Repetition::of_a_noisy_camera);
  EXPECT_EQ(repeats.add(noisy(scene(0), 12)), Repetition::none);
}

// Nothing is known of a camera after its first images, nor when its first one is shown on and on.
TEST(PictureRepeats, OfACameraThatIsNotKnownRepetitionMayBeRest) {
  PictureRepeats repeats;
  EXPECT_EQ(repeats.add(noisy(scene(0), 1)), Repetition::none);
  for (int k = 0; k < 30; ++k) EXPECT_EQ(repeats.add(noisy(scene(0), 1)), Repetition::possible_at_rest);
}

// However long a bar moves, and when the light has changed for as long as a noisy camera needs.
TEST(PictureRepeats, ACameraWithoutNoiseMayShowRest) {
  PictureRepeats repeats;
  for (int k = 0; k < 30; ++k) EXPECT_EQ(repeats.add(scene(k)), Repetition::none);
  EXPECT_EQ(repeats.add(scene(29)), Repetition::possible_at_rest);
  for (int k = 0; k < 30; ++k) EXPECT_EQ(repeats.add(scene(29) + cv::Scalar(k + 1, k + 1, 0)), Repetition::none);
  EXPECT_EQ(repeats.add(scene(29) + cv::Scalar(30, 30, 0)), Repetition::possible_at_rest);
}

TEST(PictureRepeats, ANoisyRoundPictureInBlackIsTold) {
  cv::Mat round(height, width, CV_8UC1, cv::Scalar(0));
  cv::circle(round, {width / 2, height / 2}, height / 2, cv::Scalar(255), cv::FILLED);
  const auto seen = [&](int seed) {
    cv::Mat picture(height, width, CV_8UC3, cv::Scalar(0, 0, 0));
    noisy(scene(0), seed).copyTo(picture, round);
    return picture;
  };
  PictureRepeats repeats;
  for (int k = 0; k < 12; ++k) EXPECT_EQ(repeats.add(seen(k)), Repetition::none);
  EXPECT_EQ(repeats.add(seen(11)), Repetition::of_a_noisy_camera);
}

TEST(PictureRepeats, PicturesOfOtherSizesAreOthers) {
  PictureRepeats repeats;
  repeats.add(scene(0));
  EXPECT_EQ(repeats.add(scene(0).rowRange(0, 90)), Repetition::none);
  EXPECT_EQ(repeats.add(cv::Mat()), Repetition::none);
}

}  // namespace lapservo::internal::picture_repeats_test
