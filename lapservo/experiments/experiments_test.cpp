#include <cmath>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/experiments/illumination.h"
#include "lapservo/experiments/rcm.h"
#include "lapservo/experiments/rotation.h"
#include "lapservo/experiments/stage.h"
#include "lapservo/experiments/tracking.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::experiments_test {

constexpr std::uint64_t seed = 73;

TEST(Positions, AreInViewSpreadOutAndRepeatable) {
  const Rig rig = paper_rig();
  Random random(seed), again(seed), alone(seed + 1);
  const auto positions = spread_positions(rig, 20, random), same = spread_positions(rig, 20, again);
  std::vector<JointVector> plain;
  for (int i = 0; i < 20; ++i) plain.push_back(spread_positions(rig, 1, alone)[0]);
  const auto nearest = [&](const std::vector<JointVector>& all) {
    double sum = 0;
    for (std::size_t i = 0; i < all.size(); ++i) {
      double least = HUGE_VAL;
      for (std::size_t k = 0; k < all.size(); ++k)
        if (k != i)
          least = std::min(least, (marker_middle_px(rig.camera, rig.instruments[0], all[i]) -
                                   marker_middle_px(rig.camera, rig.instruments[0], all[k]))
                                      .norm());
      sum += least / static_cast<double>(all.size());
    }
    return sum;
  };
  for (std::size_t i = 0; i < positions.size(); ++i) {
    EXPECT_TRUE(marker_in_view(rig.camera, rig.instruments[0].marker,
                               *rig.instruments[0].camera_from_rcm * rcm_from_unrolled(positions[i]),
                               {.steepest_rad = 0.35, .border_px = 30}))
        << "seed " << seed;
    EXPECT_EQ(positions[i].vector(), same[i].vector());
  }
  EXPECT_GT(nearest(positions), 1.3 * nearest(plain)) << "mean distance to the nearest other";
}

TEST(Positions, ThatAreNeverInViewAreAnError) {
  Rig rig = paper_rig();
  rig.instruments[0].camera_from_rcm->translation.z() = -5;
  Random random(seed);
  EXPECT_THROW(spread_positions(rig, 1, random), InputError);
}

TEST(Eyes, SeeTheRigItselfWhateverItsSigmasAre) {
  Rig rig = testing::small_test_rig();
  Random random(seed);
  const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, seed),
                frame = Stage(rig, tissue).render(spread_positions(rig, 1, random)[0], 1, seed);
  const auto variance = [&] { return Eyes(rig, {Method::surface}).observe(frame)[0].rcm.value().covariance(3, 3); };
  const double exact = variance();
  rig.instruments[0].sigma_translation_m = {1e-3, 1e-3, 1e-3};
  rig.instruments[0].sigma_quaternion_xyzw = {3e-3, 3e-3, 3e-3, 3e-3};
  rig.instruments[0].marker.sigmas.seam_rad = 0.012, rig.instruments[0].marker.tolerance_m = 1e-4;
  EXPECT_EQ(variance(), exact);
}

TEST(SingleInstrument, NeedsARegistration) {
  Rig rig = paper_rig();
  rig.instruments.push_back(rig.instruments[0]);
  EXPECT_EQ(single_instrument(rig, "a.yaml").instruments.size(), 1U);
  rig.instruments[0].camera_from_rcm.reset();
  EXPECT_TRUE(testing::input_error([&] {
                single_instrument(rig, "a.yaml");
              }).starts_with("a.yaml: instruments[0].camera_from_rcm"));
}

TEST(Rotation, TrialsStartWhereThePapersDo) {
  EXPECT_DOUBLE_EQ(initial_rotation_rad(0), -3.5);
  EXPECT_DOUBLE_EQ(initial_rotation_rad(9), -1.25);
  EXPECT_NEAR(initial_rotation_rad(4) - initial_rotation_rad(3), 0.25, 1e-12);
}

TEST(Rotation, IsSummedUpByTrial) {
  Random random(seed);
  std::vector<RotationResult::Sample> samples;
  for (int trial = 0; trial < RotationResult::trials; ++trial)
    for (int step = 0; step < 2000; ++step) {
      const double sigma = 0.01 * (trial + 1), truth = random.uniform(-4, 4);
      samples.push_back({0, trial, step, truth, truth + 0.1 * trial + sigma * random.normal(), sigma});
    }
  const auto of_method = summed_up(Method::surface, samples);
  ASSERT_EQ(of_method.by_trial.size(), static_cast<std::size_t>(RotationResult::sets * RotationResult::trials));
  for (int trial = 0; trial < RotationResult::trials; ++trial) {
    const Spread& spread = of_method.by_trial[static_cast<std::size_t>(trial)];
    EXPECT_NEAR(spread.deviation, 0.01 * (trial + 1), 0.001 * (trial + 1)) << "seed " << seed;
    EXPECT_NEAR(spread.mean, 0.1 * trial, 0.002 * (trial + 1));
  }
  EXPECT_NEAR(of_method.all.mean, 0.45, 0.01);
  EXPECT_NEAR(of_method.under_100mrad, 0.15, 0.01) << "trial 0 and half of trial 1";
  const std::string from_trial_to_trial = section_of(RotationResult{{of_method}}, {}).comparisons[0].surface;
  EXPECT_FALSE(from_trial_to_trial.starts_with("0.00 ")) << "those of other sets were not found";
}

// Parts put together again have the mean, deviation and rms of the whole.
TEST(Rotation, PartsArePooledWithTheirBias) {
  Random random(seed);
  std::vector<double> all, means, deviations;
  for (int part = 0; part < 4; ++part) {
    std::vector<double> errors;
    for (int i = 0; i < 50000; ++i) errors.push_back(0.3 * part + (1 + part) * random.normal());
    const Spread spread = spread_of(errors);
    means.push_back(spread.mean), deviations.push_back(spread.deviation);
    all.insert(all.end(), errors.begin(), errors.end());
  }
  const Spread whole = spread_of(all);
  const Pooled of_parts = pooled(means, deviations);
  EXPECT_NEAR(of_parts.mean, whole.mean, 1e-9);
  EXPECT_NEAR(of_parts.deviation, whole.deviation, 1e-4);
  EXPECT_NEAR(of_parts.rms, whole.rms, 1e-4);
}

TEST(Rcm, IntersectionsAreAllPairsOfASet) {
  const Eigen::Vector2d through(100, 50);
  std::vector<RcmResult::Line> lines;
  for (int set = 0; set < 2; ++set)
    for (int position = 0; position < RcmResult::positions; ++position) {
      const double angle = 0.1 * position;
      const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
      lines.push_back({set, position, through + 200 * along, through + 300 * along});
    }
  const auto found = intersections_of(lines, through + Eigen::Vector2d(3, 4));
  ASSERT_EQ(found.size(), 2U * RcmResult::pairs);
  EXPECT_EQ(RcmResult::pairs, 190);
  for (const RcmResult::Intersection& at : found) {
    EXPECT_LT((at.px - through).norm(), 1e-9);
    EXPECT_NEAR(at.distance_px, 5, 1e-9);
    const double apart = 0.1 * (at.second - at.first);
    EXPECT_NEAR(at.angle_rad, std::min(apart, pi - apart), 1e-7);
  }
}

TEST(Rcm, IsBroughtIntoViewUnlessItIs) {
  const Rig given = paper_rig(), moved = with_rcm_in_view(given);
  const auto raw_px = [](const Rig& rig) {
    return rig.camera.raw_from_point(rig.instruments[0].camera_from_rcm->translation);
  };
  EXPECT_LT(raw_px(given).x(), 0) << "the paper's trajectory needs it outside";
  EXPECT_TRUE(moved.camera.contains(raw_px(moved)));
  EXPECT_EQ(with_rcm_in_view(moved).instruments[0].camera_from_rcm->translation,
            moved.instruments[0].camera_from_rcm->translation);
}

// The largest distance of each point, only for points with all four measurements.
TEST(Illumination, TakesTheLargestOfFour) {
  std::vector<IlluminationResult::Point> points;
  for (int position = 0; position < 2; ++position)
    for (int point = 0; point < 4; ++point)
      for (int light = 0; light < (position == 1 && point == 3 ? 3 : 4); ++light)
        points.push_back({position, light, point, {0, 0}, 0.1 * light + position, 0});
  points.push_back({2, 0, 0, {0, 0}, std::nan(""), 0});  // the only one of its kind
  const auto of_method = summed_up(Method::surface, points);
  ASSERT_EQ(of_method.largest.size(), 7U);
  EXPECT_EQ(of_method.to_centroid.count, 31U);
  EXPECT_NEAR(of_method.largest[0].px, 0.3, 1e-12);
  EXPECT_NEAR(of_method.of_largest.mean, (4 * 0.3 + 3 * 1.3) / 7, 1e-12);
}

// Errors drawn from the covariance that is stated have unit spread in its units, however oblong it is.
TEST(Rcm, ErrorsInSigmasAreOneWhenTheCovarianceIsHonest) {
  Random random(seed);
  std::vector<RcmResult::Estimate> estimates;
  for (int set = 0; set < 4000; ++set) {
    Eigen::Matrix2d root;
    root << random.uniform(1, 20), 0, random.uniform(-10, 10), random.uniform(0.1, 1);
    const Eigen::Vector2d error = root * Eigen::Vector2d(random.normal(), random.normal());
    estimates.push_back({set, error, root * root.transpose()});
  }
  EXPECT_NEAR(summed_up(estimates).in_sigmas, 1, 0.03) << "seed " << seed;
  for (auto& estimate : estimates) *estimate.covariance_px2 *= 0.25;
  EXPECT_NEAR(summed_up(estimates).in_sigmas, 2, 0.06);
  EXPECT_EQ(summed_up({{0, {3, 4}, {}}}).distance.mean, 5);
}

// A whole experiment, small: better than the paper, data complete, the same again whichever thread did what.
TEST(Illumination, EndToEnd) {
  ExperimentSetup setup;
  setup.rig = testing::small_test_rig(), setup.seed = seed, setup.methods = {Method::surface};
  const IlluminationResult result = measure_illumination(setup);
  ASSERT_EQ(result.methods.size(), 1U);
  EXPECT_EQ(result.methods[0].points.size(), 320U);
  EXPECT_LT(result.methods[0].to_centroid.mean, 0.15);

  const testing::TemporaryFolder folder;
  const auto text = [&](const IlluminationResult& of) {
    write_data(of, folder.path());
    return testing::read_file(folder / "illumination.csv");
  };
  const std::string first = text(result);
  EXPECT_EQ(CsvTable::parse(first, "illumination.csv").rows(), 320U);
  EXPECT_EQ(result.methods[0].largest.size(), 80U);
  EXPECT_EQ(text(measure_illumination(setup)), first);

  const ReportSection section = section_of(result, setup);
  EXPECT_EQ(section.comparisons[0].centerline, "") << "was not requested";
  EXPECT_NE(section.comparisons[0].surface, "");

  setup.keep_going = [](int done, int) { return done < 3; };
  EXPECT_THROW(measure_illumination(setup), Interrupted);
}

TEST(Tracking, StoppedInItsSecondRunKeepsTheFirst) {
  ExperimentSetup setup;
  setup.rig = paper_rig(), setup.seed = seed;
  const auto first_run = static_cast<int>(TrackingScenario{}.duration_s / tracking_period_s);
  setup.keep_going = [first_run](int done, int) { return done < first_run + 5; };
  const TrackingResult result = measure_tracking(setup);
  ASSERT_EQ(result.runs.size(), 1U) << "seed " << seed;
  EXPECT_GT(result.missing.size(), 3U);
  EXPECT_TRUE(result.runs[0].converged_s);

  const ReportSection section = section_of(result, setup);
  for (const std::string& title : result.missing) EXPECT_NE(section.unfinished.find(title), std::string::npos);
  const double images_hz = tracking_simulator(result.runs[0].scenario, setup.seed).endoscope.frame_rate_hz;
  EXPECT_NE(section.text[0].find(fmt::format("{:.0f} frames/s", images_hz)), std::string::npos) << section.text[0];
  EXPECT_EQ(section.files, std::vector<std::string>{"tracking_default.csv"});
  for (const Comparison& row : section.comparisons)
    EXPECT_FALSE(row.centerline.empty() && row.surface.empty()) << row.what;
}

}  // namespace lapservo::internal::experiments_test
