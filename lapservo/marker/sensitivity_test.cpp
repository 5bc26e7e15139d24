#include "lapservo/marker/sensitivity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/marker.h"
#include "lapservo/testing/markers.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::sensitivity_test {
using testing::marker_with;

const Marker linear = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
const Marker non_linear = marker_with({0.004, 0.012, 0.008}, {0.012, 0.004, 0.008});

TEST(CrossRatioSlope, IsTheFiniteDifference) {
  for (const Marker& marker : {linear, non_linear})
    for (double tau_rad = 0.01; tau_rad < 6.27; tau_rad += 0.05) {
      constexpr double step_rad = 1e-5;
      const double difference = cross_ratio_at(marker, tau_rad + step_rad) - cross_ratio_at(marker, tau_rad - step_rad);
      EXPECT_NEAR(cross_ratio_slope(marker, tau_rad), difference / (2 * step_rad), 1e-8) << "tau " << tau_rad;
    }
}

// How much each boundary moves what the decoder reads, rad per m: finite differences.
std::array<double, 4> decoded_by_boundaries(const Marker& marker, double tau_rad) {
  constexpr double step_m = 1e-7;
  const CrossRatioDecoder decoder(marker);
  std::array<double, 4> by_boundaries{};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto decoded_rad = [&](double by_m) {
      auto e = boundaries_m(marker, tau_rad);
      e.at(k) += by_m;
      return decoder.tau_rad(cross_ratio(e[1] - e[0], e[2] - e[1], e[3] - e[2]));
    };
    by_boundaries.at(k) = (decoded_rad(step_m) - decoded_rad(-step_m)) / (2 * step_m);
  }
  return by_boundaries;
}

TEST(TauByBoundaries, IsWhatTheDecoderMistakes) {
  Marker marker = linear;
  marker.wrap_m = 1e-3, marker.gap_rad = 0.1;
  for (const double tau_rad : {0.5, 3.0, 5.5}) {
    const auto expected = decoded_by_boundaries(marker, tau_rad), by_boundaries = tau_by_boundaries(marker, tau_rad);
    for (std::size_t k = 0; k < 4; ++k)
      EXPECT_NEAR(expected.at(k), by_boundaries.at(k), 1e-3 * std::abs(by_boundaries.at(k)) + 1e-3);
  }
}

TEST(PredictedSigma, OfTheCentreLineIsThatOfWhatIsDecoded) {
  const Viewing viewing{1100, 0.11, 0.05};
  for (const Marker& marker : {linear, non_linear})
    for (const double tau_rad : {0.5, 1.7, 3.1, 4.4, 5.8}) {
      double square = 0;
      for (const double by_boundary : decoded_by_boundaries(marker, tau_rad)) square += by_boundary * by_boundary;
      const double sigma_rad = viewing.sigma_edge_px / viewing.px_per_m() * std::sqrt(square);
      EXPECT_NEAR(sigma_rad / predicted_sigma_centre_line_rad(marker, tau_rad, viewing), 1, 0.03) << "tau " << tau_rad;
    }
}

// Sigma of tau where least squares fit it, and a shift along the axis, to all boundaries seen on lines one pixel apart,
// from the lengths of the bands alone. A boundary whose place is within the blur of a seam at which it jumps is left
// out.
double fitted_sigma_rad(const Marker& marker, double tau_rad, const Viewing& viewing) {
  const double radius_px = marker.radius_m() * viewing.px_per_m(), reach_px = 0.9 * radius_px;
  double count = 0, sum = 0, squares = 0;
  for (double offset_px = -reach_px + 0.5; offset_px < reach_px; offset_px += 1) {
    const double line_tau_rad = wrap_two_pi(tau_rad + std::asin(offset_px / radius_px));
    if (line_tau_rad > two_pi - marker.gap_rad) continue;
    // Foreshortened: the seam's distance in the image.
    const double cosine = std::sqrt(1 - offset_px * offset_px / (radius_px * radius_px));
    const double seam_px = std::min(line_tau_rad, two_pi - marker.gap_rad - line_tau_rad) * radius_px * cosine;
    const double step_rad = line_tau_rad < pi ? 1e-3 : -1e-3;
    const auto here = boundaries_m(marker, line_tau_rad), beside = boundaries_m(marker, line_tau_rad + step_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      const bool jumps = k == 1 || k == 2 || marker.gap_rad > 0;
      if (jumps && seam_px < 2.5) continue;
      const double slope_px = (beside[k] - here[k]) / step_rad * viewing.px_per_m();
      ++count, sum += slope_px, squares += slope_px * slope_px;
    }
  }
  return viewing.sigma_edge_px / std::sqrt(squares - sum * sum / count);
}

TEST(PredictedSigma, OfTheSurfaceIsThatOfItsLeastSquaresFit) {
  const Viewing viewing{1100, 0.11, 0.1};
  Marker with_gap = linear;
  with_gap.gap_rad = 0.5;
  for (const Marker& marker : {linear, non_linear, with_gap})
    for (const double tau_rad : {0.0, 0.4, 3.0, 5.9})
      EXPECT_NEAR(fitted_sigma_rad(marker, tau_rad, viewing) / predicted_sigma_surface_rad(marker, tau_rad, viewing), 1,
                  0.02)
          << "tau " << tau_rad;
}

TEST(PredictedPrintError, IsTheSpreadOverRandomPrints) {
  const CrossRatioDecoder decoder(linear);
  constexpr double error_m = 2e-6, fraction = 0.4;
  const double tau_rad = fraction * two_pi;
  Random random(5);
  double square = 0;
  constexpr int prints = 4000;
  for (int i = 0; i < prints; ++i) {
    auto e = boundaries_m(linear, tau_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      const bool inner = k == 1 || k == 2;
      e.at(k) += error_m * (inner ? (1 - fraction) * random.normal() + fraction * random.normal() : random.normal());
    }
    const double off_rad = decoder.tau_rad(cross_ratio(e[1] - e[0], e[2] - e[1], e[3] - e[2])) - tau_rad;
    square += off_rad * off_rad / prints;
  }
  EXPECT_NEAR(std::sqrt(square) / predicted_print_error_rad(linear, tau_rad, error_m), 1, 0.05);
}

}  // namespace lapservo::internal::sensitivity_test
