#include "lapservo/core/departures.h"

#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::departures_test {

constexpr Eigen::Index rows = 300, numbers = 4, faults = 6;

Eigen::MatrixXd random_matrix(Eigen::Index columns, Random& random) {
  Eigen::MatrixXd matrix(rows, columns);
  for (double& entry : matrix.reshaped()) entry = random.normal();
  return matrix;
}

// A line's fit whose residuals have faults of these sizes in them beside noise of 1.
struct Fitted {
  LinearFit fit;
  Eigen::MatrixXd slopes;
  Eigen::VectorXd error;  // of x

  Fitted(const Eigen::VectorXd& sizes, std::uint64_t seed, bool noise_is_known) {
    Random random(seed);
    const Eigen::MatrixXd jacobian = random_matrix(numbers, random);
    slopes = random_matrix(faults, random);
    slopes += 0.5 * jacobian.col(0).replicate(1, faults);  // so that x is off by them
    const Eigen::VectorXd data = random_matrix(1, random) - slopes * sizes;
    error = -(jacobian.transpose() * jacobian).inverse() * jacobian.transpose() * data;
    fit.jacobian = jacobian.sparseView();
    fit.residuals = data + jacobian * error;
    fit.noise = noise_is_known ? 1 : 0;
    for (Eigen::Index row = 0; row <= rows; row += 3) fit.groups.push_back(row);
  }
};

Eigen::VectorXd sizes_with(std::initializer_list<std::pair<Eigen::Index, double>> some) {
  Eigen::VectorXd sizes = Eigen::VectorXd::Zero(faults);
  for (const auto& [which, size] : some) sizes[which] = size;
  return sizes;
}

TEST(Departures, FindsFaultsAndByHowMuchTheyPutANumberOff) {
  for (const bool noise_is_known : {true, false}) {
    const Fitted fitted(sizes_with({{1, 3.0}, {4, -2.0}}), 3, noise_is_known);
    const Departures departures = departures_of(fitted.fit, fitted.slopes);
    ASSERT_EQ(departures.seen.size(), 2U);
    EXPECT_EQ(departures.seen[0].which, 1U);
    EXPECT_EQ(departures.seen[1].which, 4U);
    EXPECT_NEAR(departures.seen[1].size, -2, 4 * departures.seen[1].sigma);
    EXPECT_NEAR(std::sqrt(departures.by_seen(0, 0)), std::abs(fitted.error[0]), 0.2 * std::abs(fitted.error[0]));
  }
}

TEST(Departures, SeesSeldomAFaultWhereThereIsNone) {
  constexpr int fits = 200;
  int seen = 0;
  for (int seed = 0; seed < fits; ++seed)
    for (const bool noise_is_known : {true, false}) {
      const Fitted fitted(sizes_with({}), static_cast<std::uint64_t>(seed), noise_is_known);
      const Departures departures = departures_of(fitted.fit, fitted.slopes);
      seen += !departures.seen.empty();
      EXPECT_TRUE(!departures.seen.empty() || departures.by_seen.norm() == 0);
    }
  EXPECT_LT(seen, 0.04 * 2 * fits);  // 6 faults beyond 3 sigmas: 1.6 %
}

// A prior on a number of x that does what the fault does.
void hold_by_prior(Fitted& fitted, double inverse_sigma) {
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows + 1, numbers + 1);
  jacobian.topLeftCorner(rows, numbers) = Eigen::MatrixXd(fitted.fit.jacobian);
  jacobian.col(numbers).head(rows) = fitted.slopes.col(1);
  jacobian(rows, numbers) = inverse_sigma;
  Eigen::VectorXd data = Eigen::VectorXd::Zero(rows + 1);
  data.head(rows) = fitted.fit.residuals;
  fitted.fit.residuals = data - jacobian * jacobian.householderQr().solve(data);
  fitted.fit.jacobian = jacobian.sparseView();
  fitted.slopes.conservativeResizeLike(Eigen::MatrixXd::Zero(rows + 1, faults));
}

// A fault of 1 is seen beyond the scatter at 16 sigmas. It is clear where nothing else makes as much.
TEST(Departures, AreClearWhereNothingElseMakesThem) {
  const std::vector<std::pair<std::function<void(Fitted&)>, bool>> cases{
      {[](Fitted&) {}, true},
      {[](Fitted& fitted) { fitted.fit.alike = Eigen::VectorXd::Constant(rows, 0.1); }, true},
      {[](Fitted& fitted) { fitted.fit.alike = Eigen::VectorXd::Constant(rows, 0.5); }, false},
      {[](Fitted& fitted) { fitted.fit.freedom = 2; }, true},
      {[](Fitted& fitted) { fitted.fit.freedom = 300; }, false},
      {[](Fitted& fitted) { hold_by_prior(fitted, 30); }, true},
      {[](Fitted& fitted) { hold_by_prior(fitted, 1); }, false}};
  for (const auto& [with, is_clear] : cases) {
    Fitted fitted(sizes_with({{1, 1.0}}), 3, false);
    with(fitted);
    const Departures departures = departures_of(fitted.fit, fitted.slopes);
    ASSERT_FALSE(departures.seen.empty());
    EXPECT_EQ(departures.seen[0].which, 1U);
    EXPECT_EQ(departures.seen[0].is_clear, is_clear);
  }
}

TEST(Departures, OfTwoThatLookAlikeOneIsInsteadOfTheOther) {
  Fitted fitted(sizes_with({{2, 3.0}}), 5, true);
  fitted.slopes.col(3) =
      fitted.slopes.col(2) + 1e-3 * fitted.slopes.col(0) - fitted.fit.jacobian * Eigen::Vector4d(2, 0, 0, 0);
  const Departures departures = departures_of(fitted.fit, fitted.slopes);
  ASSERT_EQ(departures.seen.size(), 1U);
  ASSERT_FALSE(departures.instead.empty());
  EXPECT_NE(departures.instead[0].which, departures.seen[0].which);
  EXPECT_GT(std::sqrt(departures.by_instead(0, 0)), 1) << "x is off by as much more, were it the other one";
}

// As a number of x that the fit has already.
TEST(Departures, SeesNothingInADirectionOfX) {
  Fitted fitted(sizes_with({}), 7, true);
  fitted.slopes.col(0) = fitted.fit.jacobian.col(1);
  const Departures departures = departures_of(fitted.fit, fitted.slopes);
  EXPECT_TRUE(departures.seen.empty());
  EXPECT_TRUE(departures.by_seen.allFinite());
}

}  // namespace lapservo::internal::departures_test
