#include "lapservo/control/trajectory.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/control/random_start.h"
#include "lapservo/control/test_simulator.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal::trajectory_test {

/// rate is the derivative of features and acceleration that of rate, at times that are no corners.
void expect_consistent(const Trajectory& trajectory, double start_s, double end_s) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const double t = random.uniform(start_s, end_s);
    constexpr double h = 1e-5;
    const auto before = trajectory.at(t - h), now = trajectory.at(t), after = trajectory.at(t + h);
    const Eigen::Vector4d rate = (after.features - before.features) / (2 * h);
    const Eigen::Vector4d acceleration = (after.rate - before.rate) / (2 * h);
    EXPECT_LT((now.rate - rate).norm(), 1e-5 * (1 + rate.norm())) << t;
    EXPECT_LT((now.acceleration - acceleration).norm(), 1e-3 * (1 + acceleration.norm())) << t;
  }
}

// Section V-D: A sin(omega t) + B with omega = 0.5 for all four.
TEST(Trajectory, ThePapersHasItsConstants) {
  const Trajectory trajectory = sinusoids(paper_sinusoids());
  for (const double t : {0.0, 1.0, 4.7, 20.0}) {
    const double swing = std::sin(0.5 * t);
    const Eigen::Vector4d expected(0.05 * swing + 0.9, 60 * swing + 795, 30 * swing + 365, 37 * swing + 212);
    EXPECT_LT((trajectory.at(t).features - expected).norm(), 1e-9) << t;
  }
}

TEST(Trajectory, ViaPointsAreReachedWithinTheLargestRate) {
  const std::vector<Eigen::Vector4d> points{{3, 700, 300, 200}, {-3, 800, 350, 180}, {-2.8, 780, 350, 240}};
  const Eigen::Vector4d max_rate(0.1, 50, 20, 30);
  const Trajectory trajectory = via_points(points, max_rate, 0.5);
  expect_consistent(trajectory, 1e-3, trajectory.duration_s - 1e-3);
  double fastest = 0;
  for (double t = 0; t <= trajectory.duration_s; t += 0.001) {
    fastest = std::max(fastest, trajectory.at(t).rate.cwiseAbs().cwiseQuotient(max_rate).maxCoeff());
  }
  EXPECT_LE(fastest, 1 + 1e-9);
  EXPECT_GT(fastest, 0.999);
  EXPECT_NEAR(trajectory.at(0).features[0], 3, 1e-12);
  const auto last = trajectory.at(trajectory.duration_s);
  EXPECT_NEAR(wrap_pi(last.features[0] + 2.8), 0, 1e-9);
  EXPECT_NEAR(last.features[3], 240, 1e-9);
  EXPECT_LT(last.rate.norm(), 1e-6);
  // s goes from 3 to -3 through pi, not through 0.
  EXPECT_GT(trajectory.at(1).features[0], 3 - 1e-9);
}

TEST(Trajectory, CsvIsASmoothCurveThroughItsRows) {
  std::string text = "time_s,s_rad,r_px,l_px,d_px\n";
  const Sinusoids f{{3.1, 795, 365, 212}, {0.3, 60, 30, 37}, {0.5, 0.6, 0.4, 0.7}, {0, 0.5, 1, 1.5}};
  const Trajectory source = sinusoids(f);
  expect_consistent(source, 0, 40);
  for (int i = 0; i <= 100; ++i) {
    const auto row = source.at(0.1 * i).features;
    text += std::to_string(0.1 * i) + "," + std::to_string(wrap_pi(row[0])) + "," + std::to_string(row[1]) + "," +
            std::to_string(row[2]) + "," + std::to_string(row[3]) + "\n";
  }
  const Trajectory trajectory = trajectory_from_csv_text(text, "path.csv");
  EXPECT_NEAR(trajectory.duration_s, 10, 1e-9);
  expect_consistent(trajectory, 0.01, 9.99);
  for (double t = 1; t < 9; t += 0.037) {
    EXPECT_NEAR(trajectory.at(t).features[0], source.at(t).features[0], 1e-4);
    EXPECT_LT((trajectory.at(t).features - source.at(t).features).norm(), 2e-3);
    EXPECT_LT((trajectory.at(t).rate - source.at(t).rate).norm(), 0.05);
  }
  EXPECT_EQ(trajectory.at(99).features, trajectory.at(10).features);
  EXPECT_TRUE(trajectory.at(99).rate.isZero());
}

TEST(Trajectory, RestsBetweenRowsThatAreEqual) {
  const Trajectory trajectory = trajectory_from_csv_text(
      "time_s,s_rad,r_px,l_px,d_px\n0,3,700,300,200\n10,3,700,300,200\n11,-3,650,300,200\n13,-3,650,300,200\n"
      "14,-3,650,300,200\n15,-3,680,300,200\n",
      "t");
  for (const auto& [start_s, end_s, r_px] : {std::array{0.0, 10.0, 700.0}, {11.0, 14.0, 650.0}})
    for (double t = start_s; t <= end_s; t += 0.25) {
      EXPECT_EQ(trajectory.at(t).features[1], r_px) << t;
      EXPECT_LT(trajectory.at(t).rate.norm() + (t < end_s ? trajectory.at(t).acceleration.norm() : 0), 1e-9) << t;
    }
  // Clamped at both ends, and at one with a natural one: their cubics by hand.
  EXPECT_NEAR(trajectory.at(10.25).features[1], 700 - 50 * (3 * 0.0625 - 2 * 0.015625), 1e-9);
  EXPECT_NEAR(trajectory.at(10.5).features[0], pi, 1e-9);
  EXPECT_NEAR(trajectory.at(14.5).features[1], 650 + 30 * (1.5 * 0.25 - 0.5 * 0.125), 1e-9);
  expect_consistent(trajectory, 10.001, 10.999);
  expect_consistent(trajectory, 14.001, 14.999);
}

TEST(Trajectory, BadInputIsNamed) {
  const auto message = [](const std::string& text) {
    return testing::input_error([&] { trajectory_from_csv_text(text, "path.csv"); });
  };
  const std::string header = "time_s,s_rad,r_px,l_px,d_px\n";
  EXPECT_NE(message(header + "0,1,2,3,4\n0,1,2,3,4\n").find("time_s"), std::string::npos);
  EXPECT_NE(message(header + "0,1,2,3,4\n1,1,2,x,4\n").find("l_px"), std::string::npos);
  EXPECT_NE(message("time_s,s_rad\n0,1\n1,1\n").find("r_px"), std::string::npos);
  EXPECT_NE(message(header + "0,1,2,3,4\n").find("two rows"), std::string::npos);
  EXPECT_NE(message(header + "1.7e9,1,2,3,4\n1.8e9,1,2,3,4\n").find("since the start"), std::string::npos);
  EXPECT_NE(message(header + "-1,1,2,3,4\n1,1,2,3,4\n").find("since the start"), std::string::npos);
  EXPECT_THROW(sinusoids({Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero(), {1, 0, 1, 1}, Eigen::Vector4d::Zero()}),
               InputError);
  EXPECT_THROW(via_points({Eigen::Vector4d::Zero()}, Eigen::Vector4d::Ones()), InputError);
  EXPECT_THROW(set_point(Eigen::Vector4d::Constant(NAN)), InputError);
}

class TrajectoryCheck : public ::testing::Test {
 protected:
  testing::TestRig rig;
  FeatureModel model = testing::model_of(rig);
  ControllerConfig config = testing::test_config({});
  Eigen::Vector4d start{0.05, 1.57, 0.064, 1};
};

TEST_F(TrajectoryCheck, RefusesAnAngleInDegrees) {
  const auto degrees = find_infeasible(set_point({51, 795, 365, 212}), 1, model, config, start);
  ASSERT_TRUE(degrees);
  EXPECT_NE(degrees->what.find("s_rad is 51, expected radians within 2 pi: it looks like degrees"), std::string::npos);
}

TEST_F(TrajectoryCheck, NamesTimeAndLimit) {
  Sinusoids off_the_image = paper_sinusoids(), fast = paper_sinusoids();
  off_the_image.amplitude[1] = 600, fast.omega_rad_s[1] = 12;
  ControllerConfig near_joint_limit = config, narrow_window = config;
  near_joint_limit.limits.upper[2] = 0.066, narrow_window.window = ImageWindow{20, 800, 20, 699};
  const auto expect_problem = [&](const Trajectory& trajectory, const ControllerConfig& with, const std::string& part) {
    const auto problem = find_infeasible(trajectory, 30, model, with, start);
    ASSERT_TRUE(problem) << part;
    EXPECT_NE(problem->what.find(part), std::string::npos) << problem->what;
  };
  expect_problem(sinusoids(off_the_image), config, "");
  EXPECT_GT(find_infeasible(sinusoids(off_the_image), 30, model, config, start)->time_s, 0);
  expect_problem(sinusoids(fast), config, "limits.rate");
  expect_problem(sinusoids(paper_sinusoids()), near_joint_limit, "limits.upper rho_m 0.066");
  expect_problem(sinusoids(paper_sinusoids()), narrow_window, "field of view");
  expect_problem(set_point({0.9, 795, 365, 900}), config, "");
  narrow_window.window->u_max_px = 700;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    Random random(seed);
    const auto draw = [&] {
      random_start(set_point(paper_sinusoids().offset), 1, model, narrow_window, Eigen::Vector4d::Zero(), random, "");
    };
    EXPECT_NE(testing::input_error(draw).find("field of view"), std::string::npos) << "keeps most starts from it";
  }
}

TEST(Trajectory, OfTheTipPassesItsPlacesAndTurnsTheShorterWay) {
  const Trajectory free = trajectory_from_csv_text("time_s,x_m,y_m,z_m\n0,0,0,0.1\n2,0.01,0,0.1\n4,0,0.01,0.12\n", "t");
  EXPECT_EQ(free.duration_s, 4);
  EXPECT_EQ(free.tip_at(2)->position_m, Eigen::Vector3d(0.01, 0, 0.1));
  EXPECT_EQ(free.tip_at(9)->position_m, Eigen::Vector3d(0, 0.01, 0.12));  // rests at the end
  EXPECT_FALSE(free.tip_at(1)->roll_rad);
  EXPECT_TRUE(free.at(1).features.array().isNaN().all());  // no features by itself
  const Trajectory turned = trajectory_from_csv_text("time_s,x_m,y_m,z_m,roll_rad\n0,0,0,0.1,3\n2,0,0,0.1,-3\n", "t");
  EXPECT_NEAR(*turned.tip_at(1)->roll_rad, pi, 1e-9);
  EXPECT_FALSE(set_point({1, 2, 3, 4}).tip_at(0));
}

TEST(Trajectory, OfTheTipRefusesOtherUnits) {
  const auto refused = [](const TipGoal& goal) { return testing::input_error([&] { tip_set_point(goal, "--tip"); }); };
  EXPECT_EQ(refused({{0.01, 0.02, 0.12}, 1.5}), "");
  EXPECT_NE(refused({{10, 20, 120}}).find("looks like millimetres"), std::string::npos);
  EXPECT_NE(refused({{0, 0, 0.1}, 90}).find("looks like degrees"), std::string::npos);
  EXPECT_NE(refused({{0, NAN, 0.1}}).find("tip.y_m: is nan, expected a finite number"), std::string::npos);
}

}  // namespace lapservo::internal::trajectory_test
