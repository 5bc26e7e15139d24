#include "lapservo/vision/model/turn_blur.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::turn_blur_test {

constexpr double lens_px = 0.95;

EdgeBlur lens() {
  return {lens_px, 1};
}

// Twenty points of each boundary, whose blur is known to 0.005 px and has these variances beyond the lens's; but for
// those that are hidden.
EdgeMeasurements boundaries_blurred_by(const std::array<double, 4>& beyond_px2,
                                       const std::vector<std::size_t>& hidden = {}) {
  constexpr std::array<double, 4> steepness{0, 7, 14, 0};
  EdgeMeasurements pass;
  for (std::size_t k = 0; k < 4; ++k) {
    if (std::find(hidden.begin(), hidden.end(), k) != hidden.end()) continue;
    for (int i = 0; i < 20; ++i) {
      Measurement m;
      m.row = UnknownVector::Zero();
      m.row[psi_unknown] = steepness[k];
      m.group = k;
      pass.all.push_back(m);
    }
    EdgeFit edge;
    edge.blur_information = 4e4F, edge.blur_gradient = static_cast<float>(4e4 * beyond_px2[k] / (2 * lens_px));
    pass.ellipse.add(edge, 1, lens(), k, {1, 0});
  }
  return pass;
}

TurnBlur blur_of_turn(double psi_variance, bool processed = false) {
  return turn_blur(boundaries_blurred_by({0, 49 * psi_variance, 196 * psi_variance, 0}), lens(), processed);
}

double of_from_rest(double turn_rad) {
  return 4.0 / 45 * turn_rad * turn_rad;
}

TEST(TurnBlur, TellsHowMuchPsiVaried) {
  for (const double variance : {0.0, 1e-4, 1e-3}) {
    const TurnBlur blur = blur_of_turn(variance);
    EXPECT_NEAR(blur.variance_rad2, variance, 1e-9 + 1e-4 * variance) << "but for the blur's prior";
    EXPECT_GT(blur.sigma_rad2, 2e-5);
    EXPECT_LT(blur.sigma_rad2, 2e-4);
  }
}

TEST(TurnBlur, DoubtsWhatIsNoTurn) {
  const double sigma = blur_of_turn(1e-3).sigma_rad2;
  EXPECT_GT(blur_of_turn(1e-3, true).sigma_rad2, 5 * sigma) << "a camera's processing blurs by colours";
  const auto of = [](const std::array<double, 4>& beyond_px2, double sides_px = 1) {
    EdgeBlur blur = lens();
    blur.sides_px = sides_px;
    const TurnBlur told = turn_blur(boundaries_blurred_by(beyond_px2), blur, false);
    return variance_of_uneven_turn(told, std::nullopt);
  };
  const double turn = of({0, 0.05, 0.2, 0});
  EXPECT_NEAR(turn, 0.05 / 49 / 12.8, 1e-8);
  EXPECT_LT(of({-0.25, 0.47, 0.1, 0.25}), 0.01 * turn) << "4:2:0 that nobody noticed";
  EXPECT_LT(of({1.2, 1.25, 1.4, 1.2}), 0.1 * turn) << "motion along the shaft";
  EXPECT_LT(of({0, 0.05, 0.2, 0}, 1.5), 0.1 * turn) << "motion across the shaft";
}

// A frame whose psi is where an even turn would have it, did not turn unevenly either.
TEST(TurnBlur, LeavesTheChangeOfPsiToTellWithoutBothInnerBoundariesAndAnEnd) {
  constexpr double turn_rad = 0.1;
  for (const std::vector<std::size_t>& hidden : {std::vector<std::size_t>{0, 3}, {1}, {2}}) {
    const TurnBlur blur = turn_blur(boundaries_blurred_by({0, 0.05, 0.2, 0}, hidden), lens(), false);
    EXPECT_EQ(blur.sigma_rad2, 0) << hidden[0];
    EXPECT_NEAR(std::sqrt(variance_of_uneven_turn(blur, turn_rad / 3)), turn_rad / 12, 1e-9) << hidden[0];
    for (const std::optional<double> change_rad : {std::optional<double>(), std::optional(0.0)})
      EXPECT_EQ(variance_of_uneven_turn(blur, change_rad), 0) << hidden[0];
  }
}

// A third of the turn within the exposure has been made in its mean.
TEST(TurnBlur, IsTakenForAStartFromRestBoundedByWhatTheTurnChangedFromFrameToFrame) {
  constexpr double turn_rad = 0.1;
  const TurnBlur blur{of_from_rest(turn_rad), 5e-5};
  EXPECT_NEAR(std::sqrt(variance_of_uneven_turn(blur, std::nullopt)), turn_rad / 12, 1e-5);
  for (const double noise : {-2.0, -1.0, 0.0, 1.0, 2.0})
    EXPECT_EQ(variance_of_uneven_turn({noise * 5e-5, 5e-5}, std::nullopt), 0) << noise;
  EXPECT_LT(std::sqrt(variance_of_uneven_turn(blur, 1e-4)), 1e-4);
  EXPECT_NEAR(std::sqrt(variance_of_uneven_turn(blur, turn_rad / 3)), turn_rad / 12, 1e-5);
  EXPECT_EQ(variance_of_uneven_turn({1e-5, 5e-5}, turn_rad / 3), 0) << "noise";
}

}  // namespace lapservo::internal::turn_blur_test
