#include "lapservo/rcm/projected_rcm.h"

#include <cmath>
#include <functional>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/rcm/pairwise_mean.h"
#include "lapservo/rcm/test_lines.h"

namespace lapservo::internal::projected_rcm_test {

using Lines = std::vector<LineObservation>;
constexpr double fan_rad = 0.9;

// Lines of very different quality, with correlated end points.
Lines uneven_lines(const Eigen::Vector2d& point, std::size_t count, Random& random) {
  Lines lines = testing::fan_of_lines(point, count, fan_rad, random);
  for (LineObservation& line : lines) {
    Eigen::Matrix4d root;
    for (double& entry : root.reshaped()) entry = random.normal();
    line.covariance_px2 = std::pow(random.uniform(0.05, 0.5), 2) * (root * root.transpose() / 4);
    line.covariance_px2.diagonal().array() += 1e-4;
  }
  return lines;
}

Lines with_errors(Lines lines, double factor, Random& random) {
  for (LineObservation& line : lines) line = testing::with_error(line, factor, random);
  return lines;
}

Eigen::Vector2d normal_of(const LineObservation& line) {
  return (line.to_px - line.from_px).normalized().unitOrthogonal();
}

// Moved across itself by 50 to 200 standard deviations.
void spoil(LineObservation& line, Random& random) {
  const double side = random.uniform() < 0.5 ? -1 : 1;
  const Eigen::Vector2d aside =
      side * random.uniform(50, 200) * std::sqrt(line.covariance_px2.trace()) * normal_of(line);
  line.from_px += aside, line.to_px += aside;
}

double mahalanobis2(const RcmEstimate& estimate, const Eigen::Vector2d& truth) {
  const Eigen::Vector2d error = estimate.point_px - truth;
  return error.dot(estimate.covariance_px2->llt().solve(error));
}

TEST(ProjectedRcm, IsExactWithoutNoise) {
  testing::SeededRandom random(71);
  for (std::size_t count = 2; count < 40; ++count) {
    const Eigen::Vector2d point(random.uniform(-2000, 2000), random.uniform(-2000, 2000));
    for (const NoiseScale scale : {NoiseScale::known, NoiseScale::estimated}) {
      const auto estimate = estimate_projected_rcm(uneven_lines(point, count, random), {scale});
      ASSERT_EQ(estimate.status, RcmStatus::ok) << count << " lines";
      EXPECT_LT((estimate.point_px - point).norm(), 1e-4);
      EXPECT_LT(estimate.chi2, 1e-8);
      EXPECT_EQ(estimate.degrees_of_freedom, static_cast<int>(count) - 2);
      EXPECT_EQ(estimate.outliers, 0u);
      EXPECT_EQ(estimate.covariance_px2.has_value(), scale == NoiseScale::known || count > 2);
    }
  }
}

TEST(ProjectedRcm, CovarianceIsHonest) {
  testing::SeededRandom random(75);
  const Eigen::Vector2d truth(-120, -240);
  constexpr int trials = 1500;
  for (const double noise_factor : {1.0, 3.0}) {
    const NoiseScale scale = noise_factor == 1 ? NoiseScale::known : NoiseScale::estimated;
    double spread = 0, chi2_fraction = 0, factor = 0;
    Eigen::Vector2d bias_sigmas = Eigen::Vector2d::Zero();
    for (int trial = 0; trial < trials; ++trial) {
      const auto estimate =
          estimate_projected_rcm(with_errors(uneven_lines(truth, 20, random), noise_factor, random), {scale});
      ASSERT_EQ(estimate.status, RcmStatus::ok);
      spread += mahalanobis2(estimate, truth) / 2 / trials;
      const Eigen::Matrix2d root = estimate.covariance_px2->llt().matrixL();
      bias_sigmas += root.inverse() * (estimate.point_px - truth) / trials;
      chi2_fraction += estimate.chi2 / estimate.degrees_of_freedom / trials;
      factor += estimate.noise_factor / trials;
    }
    EXPECT_NEAR(std::sqrt(spread), scale == NoiseScale::known ? 1 : 1.06, 0.06);  // Student's t
    EXPECT_LT(bias_sigmas.norm(), 0.1);
    EXPECT_NEAR(std::sqrt(chi2_fraction), noise_factor, 0.05 * noise_factor);
    EXPECT_NEAR(factor, scale == NoiseScale::known ? 1 : noise_factor, 0.05 * noise_factor);
  }
}

// By finite differences: an error that all lines share moves the estimate as far as the covariance says.
TEST(ProjectedRcm, CovarianceCoversWhatTheLinesShare) {
  testing::SeededRandom random(80);
  for (int trial = 0; trial < 20; ++trial) {
    const Lines lines = uneven_lines({-120, -240}, 20, random);
    const auto moved_by = [&](double from_px, double to_px) {
      Lines moved = lines;
      for (LineObservation& line : moved) {
        const Eigen::Vector2d across = normal_of(line);
        line.from_px += from_px * across, line.to_px += to_px * across;
      }
      return estimate_projected_rcm(moved, {NoiseScale::known}).point_px;
    };
    constexpr double step_px = 1e-3, common_px = 0.3;
    const Eigen::Vector2d by_from = (moved_by(step_px, 0) - moved_by(-step_px, 0)) / (2 * step_px);
    const Eigen::Vector2d by_to = (moved_by(0, step_px) - moved_by(0, -step_px)) / (2 * step_px);
    const Eigen::Matrix2d expected =
        common_px * common_px * (by_from * by_from.transpose() + by_to * by_to.transpose());
    const Eigen::Matrix2d added = *estimate_projected_rcm(lines, {NoiseScale::known, common_px}).covariance_px2 -
                                  *estimate_projected_rcm(lines, {NoiseScale::known}).covariance_px2;
    EXPECT_LT((added - expected).norm(), 1e-3 * expected.norm()) << "trial " << trial;
  }
}

TEST(ProjectedRcm, ACommonErrorThatIsNoneIsRefused) {
  for (const double common_px : {-5.0, std::nan(""), double{INFINITY}})
    EXPECT_THROW((void)estimate_projected_rcm({}, {NoiseScale::estimated, common_px}), InputError) << common_px;
}

// A fan so narrow, and noise so large, that lines weighted where they seem to be pull the estimate towards themselves.
TEST(ProjectedRcm, IsUnbiasedInANarrowFan) {
  testing::SeededRandom random(76);
  const Eigen::Vector2d truth(-120, -240), along(std::cos(0.3), std::sin(0.3));
  constexpr int trials = 600;
  double bias_px = 0, sigma_px = 0, spread = 0, mean_bias_px = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Lines lines = testing::fan_of_lines(truth, 60, 0.12, random);
    for (LineObservation& line : lines) line.covariance_px2 *= 25;
    lines = with_errors(lines, 1, random);
    const auto estimate = estimate_projected_rcm(lines, {NoiseScale::known});
    ASSERT_EQ(estimate.status, RcmStatus::ok);
    EXPECT_TRUE(estimate.near_parallel);
    bias_px += (estimate.point_px - truth).dot(along) / trials;
    sigma_px += std::sqrt(along.dot(*estimate.covariance_px2 * along)) / trials;
    spread += mahalanobis2(estimate, truth) / 2 / trials;
    mean_bias_px += (mean_of_intersections(lines)->point_px - truth).dot(along) / trials;
  }
  EXPECT_LT(std::abs(bias_px), 0.2 * sigma_px);
  EXPECT_GT(std::abs(mean_bias_px), 5 * std::abs(bias_px));
  EXPECT_NEAR(std::sqrt(spread), 1, 0.1);
}

TEST(ProjectedRcm, LeavesOutOutliersAndNamesThem) {
  testing::SeededRandom random(77);
  const Eigen::Vector2d truth(-120, -240);
  constexpr int trials = 300, spoiled = 5;
  double spread = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Lines lines = with_errors(uneven_lines(truth, 20, random), 1, random);
    for (std::size_t i = 0; i < spoiled; ++i) spoil(lines[3 * i], random);
    const auto estimate = estimate_projected_rcm(lines, {trial % 2 ? NoiseScale::known : NoiseScale::estimated});
    ASSERT_EQ(estimate.status, RcmStatus::ok);
    for (std::size_t i = 0; i < spoiled; ++i) EXPECT_FALSE(estimate.used[3 * i]) << trial;
    EXPECT_LE(estimate.outliers, spoiled + 4u) << trial;
    spread += mahalanobis2(estimate, truth) / 2 / trials;
  }
  EXPECT_NEAR(std::sqrt(spread), 1.06, 0.14);
}

TEST(ProjectedRcm, WarnsOfNearlyParallelLines) {
  testing::SeededRandom random(79);
  const Eigen::Vector2d truth(-120, -240);
  const auto of_fan = [&](double fan, double factor) {
    return estimate_projected_rcm(with_errors(testing::fan_of_lines(truth, 20, fan, random), factor, random),
                                  {NoiseScale::estimated});
  };
  for (int trial = 0; trial < 20; ++trial) {
    EXPECT_FALSE(of_fan(0.9, 1).near_parallel);
    EXPECT_TRUE(of_fan(0.05, 0.01).near_parallel);  // by their directions
    EXPECT_TRUE(of_fan(0.3, 60).near_parallel);     // by what the noise makes of them
  }
}

// A fault of a fan of lines that no one point explains, with a size in px.
const Eigen::Vector2d moves(0.6, 0.8);  // the RCM, from the first line to the last
struct Departure {
  std::string name, cause;
  std::function<void(LineObservation&, double part, double px)> apply;
};

std::vector<Departure> departures() {
  const Eigen::Vector2d middle(560, -10);
  return {{"the RCM moves", "the RCM moves by",
           [](LineObservation& line, double part, double px) {
             const Eigen::Vector2d off = (part - 0.5) * px * moves;
             line.from_px += off, line.to_px += off;
           }},
          {"a lens", "bend as by a lens",
           [=](LineObservation& line, double, double px) {
             for (Eigen::Vector2d* end : {&line.from_px, &line.to_px})
               *end += px * ((*end - middle) / 500).squaredNorm() * (*end - middle) / 500;
           }},
          {"one end beside the axis", "on one side",
           [](LineObservation& line, double, double px) { line.to_px -= px * normal_of(line); }},
          {"noise beyond the sigmas", "their own sigmas", {}}};
}

// Refuses nothing: sigmas hold for what is said, and for what is too small to be seen.
TEST(ProjectedRcm, NamesWhatNoPointExplainsAndItsSigmaHolds) {
  constexpr int trials = 100;
  const Eigen::Vector2d truth(-120, -240);
  testing::SeededRandom random(91);
  const auto tell = [&](const Departure* departure, double px, NoiseScale scale) {
    int told = 0, named = 0, wrong = 0;
    double squares = 0;
    for (int trial = 0; trial < trials; ++trial) {
      Lines lines = testing::fan_of_lines(truth, 40, fan_rad, random);
      const bool noisy = departure && !departure->apply;
      for (std::size_t i = 0; i < lines.size(); ++i) {
        if (departure && !noisy)
          departure->apply(lines[i], (static_cast<double>(i) + 0.5) / static_cast<double>(lines.size()), px);
        lines[i] = testing::with_error(lines[i], noisy ? px : 1, random);
      }
      const RcmEstimate estimate = estimate_projected_rcm(lines, {scale});
      EXPECT_EQ(estimate.status, RcmStatus::ok);
      // At some time of the recording.
      const bool drifts = departure && departure->cause == "the RCM moves by";
      const Eigen::Vector2d off =
          drifts ? Eigen::Vector2d(px * random.uniform(-0.5, 0.5) * moves) : Eigen::Vector2d::Zero();
      const double z2 = mahalanobis2(estimate, truth + off) / 2;
      squares += z2 / trials, wrong += z2 > 16;
      told += !estimate.faults.empty();
      named += departure && !estimate.faults.empty() && estimate.faults[0].find(departure->cause) != std::string::npos;
    }
    SCOPED_TRACE((departure ? departure->name : "clean") + ", px: " + std::to_string(px));
    if (px > 1 || !departure) {
      EXPECT_LE(wrong, trials / 100);
      EXPECT_LT(std::sqrt(squares), 1.4);
    }
    EXPECT_TRUE(departure || told <= trials / 20) << told;
    return std::pair(told, named);
  };
  for (const NoiseScale scale : {NoiseScale::known, NoiseScale::estimated}) {
    tell(nullptr, 0, scale);
    for (const Departure& departure : departures())
      for (const double px : {1.0, 10.0}) {
        if (!departure.apply && scale == NoiseScale::estimated) continue;  // it is what is estimated
        const auto [told, named] = tell(&departure, px, scale);
        EXPECT_GE(named, px == 10 ? 0.9 * trials : 0.8 * told - trials / 20) << departure.name;
      }
  }
}

TEST(ProjectedRcm, SaysWhyThereIsNone) {
  const auto status = [](const Lines& lines) { return estimate_projected_rcm(lines, {NoiseScale::known}).status; };
  EXPECT_EQ(status({}), RcmStatus::too_few_lines);
  const LineObservation one = line_between({0, 0}, {100, 0}, 0.3), broken = line_between({NAN, 0}, {1, 1}, 1);
  EXPECT_EQ(status({one, broken}), RcmStatus::too_few_lines);
  EXPECT_EQ(status({one, line_between({0, 9}, {100, 9}, 0.3)}), RcmStatus::parallel);
  EXPECT_EQ(status({one, line_between({0, 9}, {100, 9.1}, 0.3)}), RcmStatus::parallel);
  EXPECT_EQ(status({one, broken, line_between({0, 9}, {100, 80}, 0.3)}), RcmStatus::ok);
  for (const double slope : {0.0, 1e-6, 1e-5}) {  // whose rounding meets, exactly, somewhere
    Lines lines;
    for (int i = 0; i < 10; ++i)
      lines.push_back(line_between({100, 250 + 20.0 * i}, {400, 250 + 20.0 * i * (1 + 300 * slope)}, 1));
    EXPECT_EQ(estimate_projected_rcm(lines).status, RcmStatus::parallel) << slope;
  }
}

}  // namespace lapservo::internal::projected_rcm_test
