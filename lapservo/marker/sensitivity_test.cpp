#include "lapservo/marker/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/marker.h"
#include "lapservo/testing/markers.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal {
namespace sensitivity_test {
using testing::marker_with;

constexpr std::uint64_t seed = 43;

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

// Root mean square of tau decoded from boundaries measured with noise.
double decoded_sigma_rad(const Marker& marker, double tau_rad, const Viewing& viewing, Random& random) {
  constexpr int draws = 20000;
  const CrossRatioDecoder decoder(marker);
  double sum = 0;
  for (int i = 0; i < draws; ++i) {
    auto e_px = boundaries_m(marker, tau_rad);
    for (double& e : e_px) e = e * viewing.px_per_m() + viewing.sigma_edge_px * random.normal();
    const double ratio = cross_ratio(e_px[1] - e_px[0], e_px[2] - e_px[1], e_px[3] - e_px[2]);
    const double error_rad = decoder.tau_rad(ratio) - tau_rad;
    sum += error_rad * error_rad;
  }
  return std::sqrt(sum / draws);
}

TEST(PredictedSigma, OfTheCentreLineIsTheSpreadOfWhatIsDecoded) {
  testing::SeededRandom random(seed);
  const Viewing viewing{1100, 0.11, 0.05};
  for (const Marker& marker : {linear, non_linear})
    for (const double tau_rad : {0.5, 1.7, 3.1, 4.4, 5.8})
      EXPECT_NEAR(decoded_sigma_rad(marker, tau_rad, viewing, random) /
                      predicted_sigma_centre_line_rad(marker, tau_rad, viewing),
                  1, 0.03)
          << "tau " << tau_rad;
}

// tau and a shift along the axis, fitted by least squares to all boundaries seen on lines one pixel apart, from the
// lengths of the bands alone. An inner boundary whose place is within the seam's blur is left out.
class SurfaceFit {
 public:
  SurfaceFit(const Marker& marker, double tau_rad, const Viewing& viewing) : sigma_px_(viewing.sigma_edge_px) {
    px_per_m_ = viewing.px_per_m();
    const double radius_px = marker.radius_m() * px_per_m_, reach_px = 0.9 * radius_px;
    for (double offset_px = -reach_px + 0.5; offset_px < reach_px; offset_px += 1)
      add_line(marker, wrap_two_pi(tau_rad + std::asin(offset_px / radius_px)), offset_px, radius_px);
  }

  // Error of the fitted tau for one draw of the noise: the map is linear between seam and seam.
  double error_rad(Random& random) const {
    double b_tau = 0, b_shift = 0;
    for (const double slope : slopes_px_) {
      const double noise_px = sigma_px_ * random.normal();
      b_tau += slope * noise_px, b_shift += noise_px;
    }
    const double n = static_cast<double>(slopes_px_.size());
    return (b_tau * n - b_shift * sum_) / (squares_ * n - sum_ * sum_);
  }

 private:
  void add_line(const Marker& marker, double line_tau_rad, double offset_px, double radius_px) {
    // Foreshortened: the seam's distance in the image.
    const double cosine = std::sqrt(1 - offset_px * offset_px / (radius_px * radius_px));
    const double seam_px = std::min(line_tau_rad, two_pi - line_tau_rad) * radius_px * cosine;
    const double step_rad = line_tau_rad < pi ? 1e-3 : -1e-3;
    const auto here = boundaries_m(marker, line_tau_rad), beside = boundaries_m(marker, line_tau_rad + step_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      const bool inner = k == 1 || k == 2;
      if (inner && seam_px < 2.5) continue;
      slopes_px_.push_back((beside[k] - here[k]) / step_rad * px_per_m_);
      sum_ += slopes_px_.back(), squares_ += slopes_px_.back() * slopes_px_.back();
    }
  }

  double sigma_px_, px_per_m_ = 0, sum_ = 0, squares_ = 0;
  std::vector<double> slopes_px_;
};

TEST(PredictedSigma, OfTheSurfaceIsTheSpreadOfItsLeastSquaresFit) {
  testing::SeededRandom random(seed);
  const Viewing viewing{1100, 0.11, 0.1};
  for (const Marker& marker : {linear, non_linear})
    for (const double tau_rad : {0.0, 0.4, 3.0, 5.9}) {
      const SurfaceFit fit(marker, tau_rad, viewing);
      constexpr int draws = 5000;
      double sum = 0;
      for (int i = 0; i < draws; ++i) sum += std::pow(fit.error_rad(random), 2);
      EXPECT_NEAR(std::sqrt(sum / draws) / predicted_sigma_surface_rad(marker, tau_rad, viewing), 1, 0.04)
          << "tau " << tau_rad;
    }
}

TEST(PredictedSigma, GrowsWithNoiseAndDistanceAndFallsWithFocalLength) {
  const Viewing viewing{1100, 0.11, 0.1}, noisy{1100, 0.11, 0.3}, far_away{1100, 0.22, 0.1}, as_far{2200, 0.22, 0.1};
  for (const double tau_rad : {0.3, 2.0, 5.0}) {
    const double line = predicted_sigma_centre_line_rad(linear, tau_rad, viewing);
    EXPECT_NEAR(predicted_sigma_centre_line_rad(linear, tau_rad, noisy), 3 * line, 1e-12);
    EXPECT_NEAR(predicted_sigma_centre_line_rad(linear, tau_rad, far_away), 2 * line, 1e-12);
    EXPECT_NEAR(predicted_sigma_centre_line_rad(linear, tau_rad, as_far), line, 1e-12);
    const double surface = predicted_sigma_surface_rad(linear, tau_rad, viewing);
    EXPECT_NEAR(predicted_sigma_surface_rad(linear, tau_rad, noisy), 3 * surface, 1e-12);
    // Half the size and half the lines; more are lost to the seam.
    EXPECT_NEAR(predicted_sigma_surface_rad(linear, tau_rad, far_away) / surface, 2 * std::sqrt(2), 0.2);
    EXPECT_NEAR(predicted_sigma_surface_rad(linear, tau_rad, as_far), surface, 1e-12);
  }
}

// A boundary that is moved by little moves what the decoder reads by as much as the sensitivity says.
TEST(TauByBoundaries, IsWhatTheDecoderMistakes) {
  Marker marker = linear;
  marker.wrap_m = 1e-3, marker.gap_rad = 0.1;
  const CrossRatioDecoder decoder(marker);
  constexpr double step_m = 1e-7;
  for (const double tau_rad : {0.5, 3.0, 5.5}) {
    const auto by_boundaries = tau_by_boundaries(marker, tau_rad);
    for (std::size_t k = 0; k < 4; ++k) {
      auto e = boundaries_m(marker, tau_rad);
      e.at(k) += step_m;
      const double read_rad = decoder.tau_rad(cross_ratio(e[1] - e[0], e[2] - e[1], e[3] - e[2]));
      EXPECT_NEAR((read_rad - tau_rad) / step_m, by_boundaries.at(k), 1e-3 * std::abs(by_boundaries.at(k)) + 1e-3);
    }
  }
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

}  // namespace sensitivity_test
}  // namespace lapservo::internal
