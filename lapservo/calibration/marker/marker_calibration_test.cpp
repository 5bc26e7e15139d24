#include "lapservo/calibration/marker/marker_calibration.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/calibration/marker/print_adjustment.h"
#include "lapservo/core/angles.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::marker_calibration_test {

constexpr double mm = 1e-3;

// Off by hand: bands by up to 0.3 mm, 3 degrees of wrap.
Marker real_print(const Marker& nominal) {
  PrintShape shape = PrintShape::of(nominal);
  const std::array<double, 4> upper_mm{0, 0.25, -0.2, 0.15}, lower_mm{1.38, 1.18, 1.68, 1.53};
  for (std::size_t k = 0; k < 4; ++k) shape.upper_m[k] += mm * upper_mm[k], shape.lower_m[k] += mm * lower_mm[k];
  return shape.on(nominal);
}

struct Turn {
  int frames = 60;
  double fraction = 1.05;
  double blur_px = 0.8;
};

// Frames of a rotating print, chosen with the usual rig.
KeyFrames turned(const Rig& nominal, const Marker& print, const Turn& turn) {
  Rig real = nominal;
  real.instruments[0].marker = print;
  Random random(4);
  const JointVector start = scenes::random_configuration(nominal, 0, random);
  const RenderOptions options{.lighting = {}, .sensor = {.blur_px = turn.blur_px}};
  KeyFrames key_frames(nominal, 0);
  for (int i = 0; i < turn.frames; ++i) {
    const double fraction = static_cast<double>(i) / turn.frames;
    JointVector q = start;
    q.theta_rad += 0.02 * std::sin(two_pi * fraction);
    q.psi_rad = wrap_pi(q.psi_rad + turn.fraction * two_pi * fraction);
    key_frames.add(scenes::render(real, {q}, static_cast<std::uint64_t>(i), options), 0);
  }
  return key_frames;
}

class CalibrateMarker : public ::testing::Test {
 protected:
  const Rig rig = scenes::usual_rig();
  const Marker& nominal = rig.instruments[0].marker;
};

// The lag of a video differs between the two.
TEST_F(CalibrateMarker, KeepsFramesOfEitherWayOfTheTurn) {
  Random random(4);
  const JointVector start = scenes::random_configuration(rig, 0, random);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < 8; ++i) {
    JointVector q = start;
    q.psi_rad = wrap_pi(q.psi_rad + 0.2 * i);
    frames.push_back(scenes::render(rig, {q}, static_cast<std::uint64_t>(i)));
  }
  KeyFrames key_frames(rig, 0);
  for (int i = 0; i < 29; ++i) key_frames.add(frames[static_cast<std::size_t>(i % 14 < 8 ? i % 14 : 14 - i % 14)], 0);
  int there = 0, back = 0;
  for (const KeyFrame& frame : key_frames.take()) {
    there += frame.turned_rad > 0, back += frame.turned_rad < 0;
    if (frame.turned_rad != 0) {
      EXPECT_NEAR(std::abs(frame.turned_rad), 0.2, 0.01);
    }
  }
  EXPECT_EQ(there, 14);
  EXPECT_EQ(back, 14);
}

TEST_F(CalibrateMarker, RefusesWhatCanNotTell) {
  const Marker print = real_print(nominal);
  const auto refusal = [&](const Turn& turn) {
    return calibrate_marker(rig, 0, turned(rig, print, turn).take()).refusal;
  };
  EXPECT_TRUE(testing::has(refusal({.frames = 40, .fraction = 0.6}), "from all sides"));
  EXPECT_TRUE(testing::has(refusal({.frames = 6}), "at least"));
  EXPECT_TRUE(testing::has(refusal({.frames = 30, .blur_px = 1.8}), "blurred"));
  EXPECT_NE(refusal({.frames = 30, .blur_px = 6}), "");
  EXPECT_NE(calibrate_marker(rig, 0, {}).refusal, "");
}

}  // namespace lapservo::internal::marker_calibration_test
