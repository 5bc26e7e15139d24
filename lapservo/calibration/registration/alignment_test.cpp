#include "lapservo/calibration/registration/alignment.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/calibration/registration/test_motion.h"
#include "lapservo/testing/has.h"

namespace lapservo::internal::alignment_test {
using lapservo::testing::has;

Alignment aligned(const Recorded& data) {
  return align(with_names_only(data.truth), data.poses, data.recording, "joints.csv");
}

// Two recordings of 50 s, of which the later one begins up to 30 s after the other, by clocks that begin with them.
Motion apart(std::uint64_t seed, double seconds_apart) {
  return {.seconds = 50, .joints_from_s = seconds_apart, .seed = seed, .wave = irregular(seed)};
}

TEST(Align, ErrorsAreAsTheirSigmasSayOverAllOffsets) {
  constexpr int seeds = 20;
  double squares = 0, drift_squares = 0, worst_s = 0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    Motion motion = apart(seed, -30 + 60.0 * static_cast<double>(seed - 1) / (seeds - 1));
    if (seed % 2 != 0) motion.backlash = {0.01, 0.01, 1e-3, 0.03};
    const Recorded data = recorded(motion);
    const Alignment found = aligned(data);
    ASSERT_EQ(found.refusal, "") << seed;
    const double off_s = found.delay_s - *data.truth.image_delay_s;
    EXPECT_FALSE(found.drifts()) << seed;
    worst_s = std::max(worst_s, std::abs(off_s));
    squares += std::pow(off_s / found.sigma_delay_s, 2);
    drift_squares += std::pow(found.drift_ppm / found.sigma_drift_ppm, 2);
  }
  const double error = std::sqrt(squares / seeds);
  EXPECT_LT(worst_s, 2e-3);
  EXPECT_GT(error, 0.4) << "sigmas are doubled for what images have beside noise, and these poses have not";
  EXPECT_LT(error, 1.4);
  EXPECT_LT(std::sqrt(drift_squares / seeds), 1.4);
}

TEST(Align, FindsTheDriftOfAClock) {
  for (const double drift : {-1e-3, 2e-4}) {
    Motion motion = apart(3, 12);
    motion.drift = drift;
    const Alignment found = aligned(recorded(motion));
    ASSERT_EQ(found.refusal, "");
    EXPECT_TRUE(found.drifts());
    EXPECT_NEAR(found.drift_ppm, 1e6 * drift, 4 * found.sigma_drift_ppm);
    // The frames' stamps in the middle of what is shared: from 12 to 50 s.
    EXPECT_NEAR(found.delay_s, 12.08 + drift * 31, 2e-3);
  }
}

TEST(Align, RefusesAMotionThatRepeats) {
  Motion motion = apart(2, 10);
  motion.wave = [](std::size_t j, double t) { return std::sin(t * (j % 2 == 0 ? 1.0 : 2.0) + static_cast<double>(j)); };
  EXPECT_TRUE(has(aligned(recorded(motion)).refusal, "the motion repeats"));
}

TEST(Align, RefusesWithoutMotionAndWithAnotherOne) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Motion still = apart(seed, 3);
    still.swing = {0.01, 0.01, 0.01, 0.01};
    const Recorded at_rest = recorded(still);
    EXPECT_TRUE(has(aligned(at_rest).refusal, "moved by"));
    Recorded mixed = recorded(apart(seed, 3));
    mixed.poses = at_rest.poses;  // joints that move, a marker that does not
    EXPECT_NE(aligned(mixed).refusal, "") << seed;
    mixed.poses = recorded(apart(seed + 100, 3)).poses;
    EXPECT_NE(aligned(mixed).refusal, "") << seed;
  }
}

}  // namespace lapservo::internal::alignment_test
