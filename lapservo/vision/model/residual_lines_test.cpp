#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/vision/model/common_errors.h"

namespace lapservo::internal::residual_lines_test {

constexpr double px_per_m = 11'000, sigma_px = 0.04;

// A boundary that lies elsewhere by so much at both edges of the print, of which `wild` points are another's.
std::vector<Measurement> boundary(double at_start_m, double slope_m, int points, int wild = 0) {
  Random random(1);
  std::vector<Measurement> all;
  for (int i = 0; i < points; ++i) {
    Measurement m{};
    m.group = 1, m.sigma_px = sigma_px, m.along_px_per_m = px_per_m;
    m.turn_fraction = 0.25 + 0.5 * (i + 0.5) / points;
    m.residual_px = px_per_m * (at_start_m + slope_m * m.turn_fraction) + sigma_px * random.normal();
    if (i < wild) m.residual_px += 3;
    all.push_back(m);
  }
  return all;
}

TEST(ResidualLines, ABoundaryThatLiesElsewhereIsNoOutlier) {
  const auto all = boundary(2e-4, -1e-4, 40);
  const ResidualLine line = residual_lines(all)[1];
  EXPECT_NEAR(line.at_start, 2e-4, 1e-5);
  EXPECT_NEAR(line.slope, -1e-4, 2e-5);
  EXPECT_NEAR(scatter_sigmas(all, residual_lines(all)), 1, 0.25);
}

TEST(ResidualLines, OutliersDoNotMoveIt) {
  const auto all = boundary(2e-4, 0, 40, 10);
  const ResidualLines lines = residual_lines(all);
  EXPECT_NEAR(lines[1].at_start + lines[1].slope / 2, 2e-4, 1e-5);
  EXPECT_LT(scatter_sigmas(all, lines), 1.5) << "nor count as scatter";
}

TEST(ResidualLines, OfFewPointsThereIsNone) {
  const ResidualLine line = residual_lines(boundary(2e-4, 0, 7))[1];
  EXPECT_EQ(line.at_start, 0);
  EXPECT_EQ(line.slope, 0);
}

TEST(ResidualLines, ASidesIsAConstantInPixels) {
  auto all = boundary(0, 0, 20);
  for (Measurement& m : all) m.group = 4, m.along_px_per_m = 0, m.residual_px += 0.5;
  const ResidualLine line = residual_lines(all)[4];
  EXPECT_NEAR(line.at_start, 0.5, 0.03);
  EXPECT_EQ(line.slope, 0);
  EXPECT_LT(line.residual_px(all[0]), 5 * sigma_px);
}

}  // namespace lapservo::internal::residual_lines_test
