#include "lapservo/sim/endoscope.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::internal::endoscope_test {

EndoscopeConfig without_pictures() {
  EndoscopeConfig config;
  config.pictures = false;
  config.jitter_s = config.dropped_fraction = 0;
  return config;
}

std::vector<EndoscopePicture> taken(const EndoscopeConfig& config, std::uint64_t seed, int count) {
  Endoscope endoscope({}, {}, {}, {}, config, seed);
  for (int k = 0; k < count; ++k) endoscope.expose({});
  return endoscope.arrived(INFINITY);
}

TEST(Endoscope, JitterIsWithinItsBoundsAndKeepsTheOrder) {
  EndoscopeConfig config = without_pictures();
  config.jitter_s = 0.004;
  const auto pictures = taken(config, 3, 4000);
  double last_s = 0;
  for (const EndoscopePicture& picture : pictures) {
    const double late_s = picture.stamp_s - picture.exposed_s - config.latency_s;
    EXPECT_LE(std::abs(late_s), 0.004 + 1e-12);
    EXPECT_GE(picture.stamp_s, last_s);
    last_s = picture.stamp_s;
  }
  config.jitter_s = 0.1;  // frames would overtake one another
  last_s = 0;
  for (const EndoscopePicture& picture : taken(config, 3, 500)) {
    EXPECT_GE(picture.stamp_s, std::max(last_s, picture.exposed_s));
    last_s = picture.stamp_s;
  }
}

TEST(Endoscope, DropsTheShareThatWasAskedFor) {
  EndoscopeConfig config = without_pictures();
  config.dropped_fraction = 0.2;
  const auto pictures = taken(config, 7, 5000);
  EXPECT_NEAR(static_cast<double>(pictures.size()) / 5000, 0.8, 4 * std::sqrt(0.2 * 0.8 / 5000));
}

TEST(Endoscope, InRealTimeLeavesFramesOutAndDoesNotFallBehind) {
  Camera camera;
  camera.width_px = 640, camera.height_px = 480, camera.fx_px = camera.fy_px = 600;
  Endoscope endoscope(camera, {}, make_tissue(640, 480, 1), {}, {.real_time = true}, 1);
  long count = 0, newest = 0;
  for (int k = 0; k < 300; ++k) endoscope.expose({});
  for (; newest < 300; endoscope.expose({}))
    for (const EndoscopePicture& picture : endoscope.arrived(INFINITY)) newest = picture.index, ++count;
  EXPECT_LT(count, 100);
}

TEST(Endoscope, AnExposureHasItsMomentsEvenlyAroundItsMiddle) {
  EndoscopeConfig config = without_pictures();
  config.exposure_s = 0.01;
  config.exposure_moments = 4;
  Endoscope endoscope({}, {}, {}, {}, config, 1);
  endoscope.expose({});
  const auto moments_s = endoscope.next_moments_s();
  ASSERT_EQ(moments_s.size(), 4U);
  endoscope.expose({});
  const auto pictures = endoscope.arrived(1);
  double mean_s = 0;
  for (const double moment_s : moments_s) mean_s += moment_s / 4;
  EXPECT_NEAR(mean_s, pictures.at(1).exposed_s, 1e-12);
  EXPECT_NEAR(moments_s[3] - moments_s[0], 0.0075, 1e-12);
}

TEST(Endoscope, RefusesNonsense) {
  EndoscopeConfig config = without_pictures();
  config.frame_rate_hz = NAN;
  EXPECT_THROW(Endoscope({}, {}, {}, {}, config, 1), InputError);
  config = without_pictures();
  config.exposure_s = 0.02;
  EXPECT_THROW(Endoscope({}, {}, {}, {}, config, 1), InputError);
}

}  // namespace lapservo::internal::endoscope_test
