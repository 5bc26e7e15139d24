#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <unistd.h>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/experiments/illumination.h"
#include "lapservo/experiments/positions.h"
#include "lapservo/experiments/rcm.h"
#include "lapservo/experiments/rotation.h"
#include "lapservo/testing/rigs.h"

namespace lapservo {
namespace {
namespace fs = std::filesystem;

constexpr std::uint64_t seed = 73;

TEST(Positions, AreInViewSpreadOutAndRepeatable) {
  const Rig rig = paper_rig();
  Random random(seed), again(seed), alone(seed + 1);
  const auto positions = spread_positions(rig, 20, random), same = spread_positions(rig, 20, again);
  std::vector<RcmCoordinates> plain;
  for (int i = 0; i < 20; ++i) plain.push_back(spread_positions(rig, 1, alone)[0]);
  const auto nearest = [&](const std::vector<RcmCoordinates>& all) {
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
    EXPECT_TRUE(marker_well_in_view(rig.camera, rig.instruments[0], positions[i])) << "seed " << seed;
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

TEST(SingleInstrument, NeedsARegistration) {
  Rig rig = paper_rig();
  rig.instruments.push_back(rig.instruments[0]);
  EXPECT_EQ(single_instrument(rig, "a.yaml").instruments.size(), 1U);
  rig.instruments[0].camera_from_rcm.reset();
  try {
    single_instrument(rig, "a.yaml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("a.yaml: instruments[0].camera_from_rcm"), std::string::npos);
  }
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
      samples.push_back({trial, step, truth, truth + 0.1 * trial + sigma * random.normal(), sigma});
    }
  const auto of_method = summed_up(Method::surface, samples);
  ASSERT_EQ(of_method.by_trial.size(), static_cast<std::size_t>(RotationResult::trials));
  for (int trial = 0; trial < RotationResult::trials; ++trial) {
    const Spread& spread = of_method.by_trial[static_cast<std::size_t>(trial)];
    EXPECT_NEAR(spread.deviation, 0.01 * (trial + 1), 0.001 * (trial + 1)) << "seed " << seed;
    EXPECT_NEAR(spread.mean, 0.1 * trial, 0.002 * (trial + 1));
  }
  EXPECT_NEAR(of_method.all.mean, 0.45, 0.01);
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
  setup.rig = testing::small_test_rig();
  setup.seed = seed;
  setup.methods = {Method::surface};
  const IlluminationResult result = measure_illumination(setup);
  ASSERT_EQ(result.methods.size(), 1U);
  EXPECT_EQ(result.methods[0].points.size(), 320U);
  EXPECT_LT(result.methods[0].to_centroid.mean, 0.15);

  const fs::path folder = fs::temp_directory_path() / ("lapservo_experiment_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  const auto text = [&](const IlluminationResult& of) {
    write_data(of, folder);
    std::ifstream file(folder / "illumination.csv");
    std::stringstream all;
    all << file.rdbuf();
    return all.str();
  };
  const std::string first = text(result);
  EXPECT_EQ(CsvTable::parse(first, "illumination.csv").rows(), 320U);
  EXPECT_EQ(text(measure_illumination(setup)), first);
  fs::remove_all(folder);

  const ReportSection section = section_of(result, setup);
  EXPECT_EQ(section.comparisons[0].centerline, "") << "was not asked for";
  EXPECT_NE(section.comparisons[0].surface, "");

  setup.keep_going = [](int done, int) { return done < 3; };
  EXPECT_THROW(measure_illumination(setup), Interrupted);
}

}  // namespace
}  // namespace lapservo
