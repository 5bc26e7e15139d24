#include "lapservo/marker/decoder.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/marker/marker.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/markers.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::decoder_test {
using namespace testing;

constexpr std::uint64_t seed = 31;
const Marker falling = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});

// Where the cross-ratio, sampled finely, first turns back.
std::optional<double> first_turn_rad(const Marker& marker) {
  const auto sample = [&](int i) { return cross_ratio_at(marker, (i + 0.5) / 2000 * two_pi); };
  for (int i = 2; i < 2000; ++i)
    if ((sample(i) > sample(i - 1)) != (sample(1) > sample(0))) return i / 2000.0 * two_pi;
  return std::nullopt;
}

TEST(Marker, BoundariesAreStraightFromEdgeToEdgeOfThePrint) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 200; ++i) {
    const Marker square = random_linear_marker(random), marker = i % 2 ? askew(square, random) : square;
    ASSERT_FALSE(marker_problem(marker));
    const double end_rad = std::nextafter(marker.covered_rad(), 0.0);
    const auto upper = boundaries_m(marker, 0), lower = boundaries_m(marker, end_rad);
    EXPECT_EQ(upper[0], 0);
    EXPECT_NEAR(lower[0], marker.wrap_m, 1e-12);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(upper.at(k + 1) - upper.at(k), marker.bands_upper_m.at(k), 1e-12);
      EXPECT_NEAR(lower.at(k + 1) - lower.at(k), marker.bands_lower_m.at(k), 1e-12);
    }
    const auto slopes = boundary_slopes_m(marker);
    const double tau_rad = random.uniform(0, end_rad);
    const auto between = boundaries_m(marker, tau_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_NEAR(between.at(k), upper.at(k) + slopes.at(k) * tau_rad, 1e-12);
      EXPECT_EQ(jumps_at_seam(marker, k), marker.gap_rad > 0 || std::abs(lower.at(k) - upper.at(k)) > 1e-9);
    }
  }
}

TEST(Marker, TheGapIsBare) {
  Marker marker = falling;
  EXPECT_TRUE(is_printed(marker, two_pi - 1e-9));
  EXPECT_NEAR(distance_to_seam_rad(marker, two_pi - 0.1), 0.1, 1e-12);
  EXPECT_FALSE(jumps_at_seam(marker, 0));
  EXPECT_TRUE(jumps_at_seam(marker, 1));
  marker.gap_rad = 0.2;
  for (const double tau_rad : {-0.1, two_pi - 0.19, 4 * two_pi - 0.01}) {
    EXPECT_FALSE(is_printed(marker, tau_rad));
    EXPECT_EQ(distance_to_seam_rad(marker, tau_rad), 0);
  }
  EXPECT_TRUE(is_printed(marker, -0.21));
  EXPECT_NEAR(distance_to_seam_rad(marker, -0.3), 0.1, 1e-12);
  EXPECT_NEAR(distance_to_seam_rad(marker, 0.3), 0.3, 1e-12);
  EXPECT_TRUE(jumps_at_seam(marker, 3));
}

TEST(CrossRatioDecoder, InvertsAskewPrints) {
  testing::SeededRandom random(seed);
  int decodable = 0;
  for (int i = 0; i < 2000; ++i) {
    const Marker marker = askew(random_marker(random), random);
    if (marker_problem(marker) || !decoding_problem(marker).empty()) continue;
    ++decodable;
    const CrossRatioDecoder decoder(marker);
    for (const double fraction : {0.001, 0.3, 0.6, 0.999}) {
      const double tau_rad = fraction * marker.covered_rad();
      EXPECT_NEAR(decoder.tau_rad(cross_ratio_at(marker, tau_rad)), tau_rad, 1e-6);
    }
    EXPECT_LE(decoder.tau_rad(100), marker.covered_rad());
    EXPECT_LE(decoder.tau_rad(-100), marker.covered_rad());
  }
  EXPECT_GT(decodable, 300);
}

TEST(Marker, CrossRatioIsTheSameInEveryPerspectiveImage) {
  testing::SeededRandom random(seed);
  int checked = 0;
  for (int i = 0; i < 1000; ++i) {
    const double l1 = random.uniform(0.1, 1), l2 = random.uniform(0.1, 1), l3 = random.uniform(0.1, 1);
    const double a = random.uniform(0.5, 2), b = random.uniform(-1, 1), c = random.uniform(-0.2, 0.5);
    const auto image = [&](double x) { return (a * x + b) / (c * x + 1); };
    if (std::abs(a - b * c) < 0.1) continue;  // the line is seen end on
    const std::array<double, 4> e{image(0), image(l1), image(l1 + l2), image(l1 + l2 + l3)};
    EXPECT_NEAR(cross_ratio(std::abs(e[1] - e[0]), std::abs(e[2] - e[1]), std::abs(e[3] - e[2])),
                cross_ratio(l1, l2, l3), 1e-9);
    ++checked;
  }
  EXPECT_GT(checked, 800);
}

double round_trip_rad(const Marker& marker, double tau_rad) {
  return CrossRatioDecoder(marker).tau_rad(cross_ratio_at(marker, tau_rad));
}

// Just after the seam, all over the turn, and just before the seam again.
std::vector<double> turn_from_seam_to_seam() {
  std::vector<double> turn{0, 1e-6, 1e-4};
  for (int i = 0; i < 500; ++i) turn.push_back((i + 0.5) / 500 * two_pi);
  turn.insert(turn.end(), {two_pi - 1e-4, two_pi - 1e-6});
  return turn;
}

TEST(CrossRatioDecoder, IsExactForTheLinearFamily) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 50; ++i) {
    const Marker marker = random_linear_marker(random);
    const CrossRatioDecoder decoder(marker);
    const double at_upper = cross_ratio_at(marker, 0), rise = cross_ratio_at(marker, two_pi - 1e-9) - at_upper;
    for (const double tau_rad : turn_from_seam_to_seam()) {
      ASSERT_NEAR(round_trip_rad(marker, tau_rad), tau_rad, 1e-10) << "design " << i;
      ASSERT_NEAR(decoder.tau_rad(at_upper + rise * tau_rad / two_pi), tau_rad, 1e-8) << "eq. (18)";
    }
  }
}

// With l1 constant the quadratic that is inverted loses its leading term.
TEST(CrossRatioDecoder, InvertsADesignWhoseFirstBoundaryIsACircle) {
  const std::array<double, 3> a{0.006, 0.004, 0.014}, b{0.006, 0.012, 0.006};
  for (const Marker& marker : {marker_with(a, b), marker_with(b, a)})
    for (const double tau_rad : turn_from_seam_to_seam()) ASSERT_NEAR(round_trip_rad(marker, tau_rad), tau_rad, 1e-10);
}

TEST(CrossRatioDecoder, BeyondTheRangeGivesTheNearerEnd) {
  const Marker rising = marker_with({0.0095, 0.0095, 0.005}, {0.0035, 0.0035, 0.017});
  for (const auto& [marker, at_lowest, at_highest] :
       {std::tuple(rising, 0.0, two_pi), std::tuple(falling, two_pi, 0.0)}) {
    const CrossRatioDecoder decoder(marker);
    EXPECT_LT(decoder.lowest_cross_ratio(), decoder.highest_cross_ratio());
    EXPECT_EQ(decoder.tau_rad(decoder.lowest_cross_ratio() - 0.1), at_lowest);
    EXPECT_EQ(decoder.tau_rad(decoder.highest_cross_ratio() + 0.1), at_highest);
    EXPECT_NEAR(decoder.tau_rad(decoder.lowest_cross_ratio() + 1e-9), at_lowest, 1e-6);
    EXPECT_TRUE(std::isnan(decoder.tau_rad(std::nan(""))));
    EXPECT_TRUE(std::isnan(decoder.tau_rad(std::numeric_limits<double>::infinity())));
  }
}

TEST(DecodingProblem, IsWhereTheCrossRatioTurnsBackAndNowhereElse) {
  const std::string says = "the cross-ratio turns back near tau = ";
  testing::SeededRandom random(seed);
  int ends_higher = 0, ends_lower = 0;
  for (int i = 0; i < 300; ++i) {
    SCOPED_TRACE("design " + std::to_string(i));
    const Marker marker = random_marker(random);
    const std::string problem = decoding_problem(marker);
    const auto turn_rad = first_turn_rad(marker);
    if (!turn_rad) {
      EXPECT_EQ(problem, "");
      EXPECT_NO_THROW(CrossRatioDecoder{marker});
      continue;
    }
    ++(cross_ratio_at(marker, two_pi - 1e-6) > cross_ratio_at(marker, 0) ? ends_higher : ends_lower);
    ASSERT_TRUE(problem.starts_with(says)) << problem;
    EXPECT_NEAR(std::strtod(problem.c_str() + says.size(), nullptr), *turn_rad, 0.03);
    EXPECT_THROW(CrossRatioDecoder{marker}, std::invalid_argument);
  }
  EXPECT_GT(ends_higher, 5);
  EXPECT_GT(ends_lower, 5);
}

TEST(DecodingProblem, RefusesBandsThatDoNotChange) {
  const std::array<double, 3> same{0.008, 0.007, 0.009};
  EXPECT_EQ(decoding_problem(marker_with(same, same)),
            "the cross-ratio is the same at every rotation: the inner boundaries must slope");
}

TEST(MarkerProblem, NamesTheFirstFieldThatMakesNoMarker) {
  Marker good = falling;
  EXPECT_FALSE(marker_problem(good));
  const double nan = std::nan("");
  const auto expect_problem = [&](auto Marker::*field, const auto& value, const std::string& expected) {
    Marker marker = good;
    marker.*field = value;
    EXPECT_TRUE(marker_problem(marker).value().text().starts_with(expected)) << marker_problem(marker)->text();
  };
  using Three = std::array<double, 3>;
  expect_problem(&Marker::diameter_m, -1, "diameter_m: is -1, expected 0.0005 to 0.1 (metres)");
  expect_problem(&Marker::diameter_m, nan, "diameter_m: is nan, expected 0.0005 to 0.1 (metres)");
  expect_problem(&Marker::hues_deg, Three{90, 180, 361}, "hues_deg[2]: is 361, expected 0 to 360");
  const std::string too_near = "expected hues at least 40 degrees apart";
  expect_problem(&Marker::hues_deg, Three{350, 20, 200}, "hues_deg[1]: is 20, " + too_near);
  expect_problem(&Marker::hues_deg, Three{0, 120, 340}, "hues_deg[0]: is 0, " + too_near);
  expect_problem(&Marker::bands_upper_m, Three{0.0035, 0, 0.017},
                 "bands_upper_m[1]: is 0, expected a length above 0, up to 0.5 (metres)");
  expect_problem(&Marker::bands_lower_m, Three{0.0095, 0.0095, 0.006},
                 "bands_lower_m: is a sum of 0.025000, expected the same sum as bands_upper_m (0.024000): both ends of "
                 "the marker are circles");
  for (const double seam_rad : {nan, 90.0})
    expect_problem(
        &Marker::seam_rad, seam_rad,
        fmt::format("seam_rad: is {}, expected radians, at most a turn: larger numbers look like degrees", seam_rad));
  expect_problem(&Marker::gap_rad, -0.1, "gap_rad: ");
  expect_problem(&Marker::wrap_m, nan, "wrap_m: ");
  good.skew_m = 1e-3;
  EXPECT_TRUE(testing::has(marker_problem(good)->text(), "skew_m"));
}

// Cyclic orders differ, small shades do not; from the tip an order is reversed.
TEST(ColourOrder, IsTheSameReversedOrAnother) {
  struct Pair {
    std::array<double, 3> one, other;
    bool same, reversed;
  };
  const std::array<double, 3> usual{90, 180, 270};
  for (const Pair& pair : {Pair{usual, usual, true, false},
                           {usual, {95, 172, 268}, true, false},
                           {{359, 120, 240}, {1, 120, 240}, true, false},
                           {usual, {265, 185, 95}, false, true},
                           {usual, {95, 172, 330}, true, false},
                           {usual, {30, 180, 270}, true, false},
                           {usual, {270, 180, 30}, false, true},
                           {usual, {90, 225, 270}, false, false},
                           {usual, {180, 270, 90}, false, false},
                           {usual, {270, 90, 180}, false, false}}) {
    Marker a, b;
    a.hues_deg = pair.one, b.hues_deg = pair.other;
    EXPECT_EQ(same_colour_order(a, b), pair.same) << b.hues_deg[0];
    EXPECT_EQ(reversed_colour_order(a, b), pair.reversed) << b.hues_deg[0];
    EXPECT_EQ(reversed_colour_order(b, a), pair.reversed) << b.hues_deg[0];
  }
}

// Eq. (16) on the marker's own lengths, for any marker and each band that changes.
TEST(TauByLength, InvertsEveryBandThatChanges) {
  testing::SeededRandom random(seed);
  int bands = 0;
  for (int i = 0; i < 100; ++i) {
    const Marker marker = random_marker(random);
    for (std::size_t band = 0; band < 3; ++band) {
      if (std::abs(marker.bands_lower_m[band] - marker.bands_upper_m[band]) <= 1e-6 * marker.length_m()) continue;
      ++bands;
      for (int k = 0; k < 50; ++k) {
        const double tau_rad = random.uniform(0, two_pi);
        const auto e = boundaries_m(marker, tau_rad);
        ASSERT_NEAR(tau_by_length_rad(marker, band, e[band + 1] - e[band]), tau_rad, 1e-6);
      }
    }
  }
  EXPECT_GT(bands, 200);
}

TEST(TauByLength, ClampsWhatNoBandShowsAndRefusesABandThatStaysAsLong) {
  EXPECT_EQ(tau_by_length_rad(falling, 0, 0), 0);
  EXPECT_EQ(tau_by_length_rad(falling, 0, 1), two_pi);
  EXPECT_EQ(tau_by_length_rad(falling, 2, 0), two_pi);
  EXPECT_EQ(tau_by_length_rad(falling, 2, 1), 0);
  EXPECT_TRUE(std::isnan(tau_by_length_rad(falling, 0, std::numeric_limits<double>::infinity())));
  const Marker marker = marker_with({0.004, 0.012, 0.008}, {0.012, 0.004, 0.008});
  EXPECT_THROW(tau_by_length_rad(marker, 2, 0.008), std::invalid_argument);
  EXPECT_THROW(tau_by_length_rad(marker, 3, 0.008), std::out_of_range);
}

}  // namespace lapservo::internal::decoder_test
