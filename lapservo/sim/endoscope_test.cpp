#include "lapservo/sim/endoscope.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

EndoscopeConfig without_pictures() {
  EndoscopeConfig config;
  config.pictures = false;
  config.jitter_s = config.dropped_fraction = 0;
  return config;
}

std::vector<EndoscopePicture> taken(const EndoscopeConfig& config, std::uint64_t seed, int count) {
  Endoscope endoscope({}, {}, {}, {}, config, seed);
  for (int k = 0; k < count; ++k) endoscope.expose({});
  return endoscope.arrived(std::numeric_limits<double>::infinity());
}

TEST(Endoscope, FramesAreExposedAtTheirRateAndArriveAfterTheLatency) {
  EndoscopeConfig config = without_pictures();
  config.frame_rate_hz = 50;
  config.latency_s = 0.123;
  const auto pictures = taken(config, 1, 100);
  ASSERT_EQ(pictures.size(), 100U);
  for (std::size_t k = 0; k < pictures.size(); ++k) {
    EXPECT_EQ(pictures[k].index, static_cast<long>(k));
    EXPECT_NEAR(pictures[k].exposed_s, static_cast<double>(k) / 50, 1e-12);
    EXPECT_NEAR(pictures[k].stamp_s, pictures[k].exposed_s + 0.123, 1e-12);
  }
}

TEST(Endoscope, JitterIsEvenWithinItsBoundsAndKeepsTheOrder) {
  EndoscopeConfig config = without_pictures();
  config.jitter_s = 0.004;
  const auto pictures = taken(config, 3, 4000);
  double sum = 0, squares = 0, last_s = 0;
  for (const EndoscopePicture& picture : pictures) {
    const double late_s = picture.stamp_s - picture.exposed_s - config.latency_s;
    EXPECT_LE(std::abs(late_s), 0.004 + 1e-12);
    EXPECT_GE(picture.stamp_s, last_s);
    last_s = picture.stamp_s;
    sum += late_s;
    squares += late_s * late_s;
  }
  EXPECT_NEAR(sum / 4000, 0, 2e-4);
  EXPECT_NEAR(std::sqrt(squares / 4000), 0.004 / std::sqrt(3), 1e-4);
  config.jitter_s = 0.1;  // frames would overtake one another
  last_s = 0;
  for (const EndoscopePicture& picture : taken(config, 3, 500)) {
    EXPECT_GE(picture.stamp_s, std::max(last_s, picture.exposed_s));
    last_s = picture.stamp_s;
  }
}

TEST(Endoscope, DropsTheShareThatWasAskedForAndAlwaysTheSameOnes) {
  EndoscopeConfig config = without_pictures();
  config.dropped_fraction = 0.2;
  const auto once = taken(config, 7, 5000), again = taken(config, 7, 5000), other = taken(config, 8, 5000);
  EXPECT_NEAR(static_cast<double>(once.size()) / 5000, 0.8, 4 * std::sqrt(0.2 * 0.8 / 5000));
  ASSERT_EQ(once.size(), again.size());
  bool same_as_other = once.size() == other.size();
  for (std::size_t k = 0; k < once.size(); ++k) {
    EXPECT_EQ(once[k].index, again[k].index);
    EXPECT_EQ(once[k].stamp_s, again[k].stamp_s);
    same_as_other = same_as_other && once[k].index == other[k].index;
  }
  EXPECT_FALSE(same_as_other);
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
  config.frame_rate_hz = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(Endoscope({}, {}, {}, {}, config, 1), InputError);
  config = without_pictures();
  config.exposure_s = 0.02;
  EXPECT_THROW(Endoscope({}, {}, {}, {}, config, 1), InputError);
}

}  // namespace
}  // namespace lapservo::internal
