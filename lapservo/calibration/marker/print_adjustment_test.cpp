#include "lapservo/calibration/marker/print_adjustment.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::print_adjustment_test {

// Exact measurements of a rotation.
std::vector<ViewMeasurements> seen_turn(const Rig& rig) {
  constexpr int frames = 20;
  Random random(4);
  const JointVector start = scenes::random_configuration(rig, 0, random);
  MarkerSurvey survey(rig, 0);
  const ViewMeasurer measurer(rig, 0);
  std::vector<ViewMeasurements> views;
  for (int i = 0; i < frames; ++i) {
    JointVector q = start;
    q.psi_rad = wrap_pi(q.psi_rad + two_pi * i / frames);
    const cv::Mat bgr = scenes::render(rig, {q}, static_cast<std::uint64_t>(i));
    if (const auto sighting = survey.find(bgr))
      views.push_back(measurer.measure({bgr, rig.camera}, rig.instruments[0].marker, *sighting, {}));
  }
  return views;
}

// The same there, or there and back, with the seam's edges so far behind.
std::vector<ViewMeasurements> passing(const std::vector<ViewMeasurements>& seen, double lag_px, bool and_back) {
  std::vector<ViewMeasurements> views;
  for (const double turned_rad : {0.1, -0.1})
    for (const ViewMeasurements& view : seen) {
      if (turned_rad < 0 && !and_back) continue;
      ViewMeasurements& passed = views.emplace_back(view);
      passed.turned_rad = turned_rad;
      if (!passed.seam) continue;
      for (auto* edge : {&passed.seam->upper, &passed.seam->lower}) {
        if (!*edge) continue;
        const double by_psi = (*edge)->row[psi_unknown];
        (*edge)->residual_px -= by_psi * turned_rad > 0 ? lag_px : -lag_px;
      }
    }
  return views;
}

class SeamLag : public ::testing::Test {
 protected:
  static Rig with_gap() {
    Rig rig = scenes::usual_rig();
    rig.instruments[0].marker.gap_rad = 0.24;
    return rig;
  }
  const Rig rig = with_gap();
  static const std::vector<ViewMeasurements>& seen() {
    static const std::vector<ViewMeasurements> views = seen_turn(with_gap());
    return views;
  }
  // Largest difference of the print's lengths when the seam stays behind.
  double by_lag_m(bool and_back) const {
    const Marker& marker = rig.instruments[0].marker;
    const auto without = adjust(passing(seen(), 0, and_back), marker, {});
    const auto with = adjust(passing(seen(), 0.2, and_back), marker, {});
    return (without->print - with->print).head<print_numbers - 1>().cwiseAbs().maxCoeff();
  }
};

TEST_F(SeamLag, IsTakenOffWhereTheTurnGoesBothWays) {
  const double both_m = by_lag_m(true), one_m = by_lag_m(false);
  EXPECT_GT(one_m, 5e-6) << "the test's own power";
  EXPECT_LT(both_m, 0.15 * one_m);
}

// That the lower edge lies elsewhere in the second half, or that e1 is curved.
TEST_F(SeamLag, IsNoFaultAndASmallFaultIsNone) {
  for (const auto kind : {PrintFault::Kind::slips, PrintFault::Kind::curved})
    for (const double size_m : {0.02e-3, 0.1e-3}) {
      auto views = passing(seen(), 0, true);
      for (std::size_t i = 0; i < views.size(); ++i) {
        views[i].time_s = static_cast<double>(i);
        for (Measurement& m : views[i].edges.all) {
          const double lower = m.turn_fraction, off_px = size_m * m.along_px_per_m;
          if (kind == PrintFault::Kind::slips && m.group < 4 && 2 * i >= views.size()) m.residual_px += lower * off_px;
          if (kind == PrintFault::Kind::curved && m.group == 1) m.residual_px += 4 * lower * (1 - lower) * off_px;
        }
      }
      const auto faults = adjust(views, rig.instruments[0].marker, {.with_covariance = true})->faults;
      EXPECT_EQ(std::any_of(faults.begin(), faults.end(), [=](const PrintFault& fault) { return fault.kind == kind; }),
                size_m > least_edge_m)
          << static_cast<int>(kind) << " " << size_m;
    }
}

// As many one way as there and back.
std::vector<ViewMeasurements> passing_twice(const std::vector<ViewMeasurements>& seen, bool and_back) {
  std::vector<ViewMeasurements> views = passing(seen, 0, and_back);
  if (and_back) return views;
  const auto again = views;
  views.insert(views.end(), again.begin(), again.end());
  return views;
}

constexpr double compressed_px = 0.1;  // noise of edges in compressed video

void add_noise(double noise_px, ViewMeasurements& view) {
  for (Measurement& m : view.edges.all) m.sigma_px = std::hypot(m.sigma_px, noise_px);
}

TEST_F(SeamLag, IsNotToldByFramesThatHardlyMove) {
  auto views = passing(seen(), 0, true);
  for (ViewMeasurements& view : views) {
    if (view.turned_rad < 0) view.turned_rad *= 0.01;
    add_noise(compressed_px, view);
  }
  EXPECT_TRUE(adjust(views, rig.instruments[0].marker, {})->lags);
}

TEST_F(SeamLag, IsDoubtedInACompressedTurnOfOneWay) {
  const Marker& marker = rig.instruments[0].marker;
  const auto sigma_and_doubt = [&](bool and_back, double noise_px) {
    auto views = passing_twice(seen(), and_back);
    for (ViewMeasurements& view : views) add_noise(noise_px, view);
    const auto adjustment = adjust(views, marker, {.with_covariance = true});
    // A print that is rotated as a whole.
    const auto slopes_m = boundary_slopes_m(marker);
    PrintNumbers turned = PrintNumbers::Zero();
    for (int k = 0; k < 4; ++k) {
      if (k > 0) turned[k - 1] = slopes_m[static_cast<std::size_t>(k)];
      turned[3 + k] = slopes_m[static_cast<std::size_t>(k)];
    }
    const Eigen::VectorXd information = solve_symmetric(*adjustment->covariance, turned);
    const double sigma_rad = 1 / std::sqrt(turned.dot(information));
    return std::pair{sigma_rad, adjustment->lags};
  };
  EXPECT_FALSE(sigma_and_doubt(false, 0).second);
  const auto [one_way_rad, one_way_lags] = sigma_and_doubt(false, compressed_px);
  const auto [both_rad, both_lags] = sigma_and_doubt(true, compressed_px);
  EXPECT_TRUE(one_way_lags);
  EXPECT_FALSE(both_lags);
  EXPECT_GT(one_way_rad, 1.2 * both_rad);
}

}  // namespace lapservo::internal::print_adjustment_test
