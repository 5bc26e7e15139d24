#include "lapservo/servo/tip_goals.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/minimum_jerk.h"
#include "lapservo/core/random.h"
#include "lapservo/servo/goal_check.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::tip_goals_test {

const JointVector there{0.05, 1.57, 0.064, 1.2};

// A rod that ends behind the marker.
Tool straight_tool() {
  Tool tool;
  tool.place.emplace().base_in_marker_m = {0, 0, 0.045};
  return tool;
}

Rig rig_with(const Tool& tool) {
  Rig rig = testing::paper_test_rig();
  rig.instruments[0].tool = tool;
  return rig;
}

JointState joints_at(double time_s, const JointVector& q, std::vector<double> wrist_rad = {}) {
  JointState joints;
  joints.time_s = time_s;
  joints.q = q;
  joints.wrist_rad = std::move(wrist_rad);
  return joints;
}

// Where things are, beside what the rig says.
struct Truth {
  Rig rig;

  Rigid3 camera_from_marker(const JointVector& q) const {
    return lapservo::camera_from_marker(rig.instruments[0].marker, *rig.instruments[0].camera_from_rcm, q);
  }
  Eigen::Vector3d tip_at(const JointVector& q, const std::vector<double>& wrist_rad) const {
    return camera_from_marker(q) * tip_in_marker(*rig.instruments[0].tool, wrist_rad).marker_from_tip.translation;
  }
  // As a perfect tracker with the registration of `known` would measure it.
  ImageMeasurement image_of(const JointVector& q, double time_s, const Rig& known) const {
    ImageMeasurement image;
    image.found = true;
    image.time_s = time_s;
    image.features = feature_model(rig)(q.vector()).value().features;
    // r counts from where the rig has the RCM.
    const Eigen::Vector2d e0_px = feature_model(rig)(q.vector()).value().ends_px.head<2>();
    image.features[1] = (e0_px - rcm_image_px(known, std::nullopt).value()).norm();
    image.camera_from_marker = camera_from_marker(q);
    return image;
  }
};

// Without any correction, and where registration and truth are one.
TEST(TipGoals, FeaturesAreThoseOfTheConfigurationThatHoldsTheTipThere) {
  Random random(81);
  for (const Tool& tool : {straight_tool(), placed_tool()}) {
    const Rig rig = rig_with(tool);
    const std::vector<double> wrist_rad(tool.wrist.size(), 0.4);
    for (int trial = 0; trial < 20; ++trial) {
      TipGoals tips(rig, {});
      const JointVector q = JointVector::from_vector(
          there.vector() +
          Eigen::Vector4d(0.03, 0.03, 0.004, 0.5)
              .cwiseProduct(Eigen::Vector4d(random.normal(), random.normal(), random.normal(), random.normal())));
      const Eigen::Vector3d tip_m = Truth{rig}.tip_at(q, wrist_rad);
      tips.follow(joints_at(0, q, wrist_rad));
      for (const auto& roll_rad : {std::optional<double>(), std::optional(q.psi_rad)}) {
        const Trajectory features = tips.features_of(tip_set_point({tip_m, roll_rad}, ""));
        const DesiredFeatures desired = features.at(1);
        EXPECT_LT((desired.features - feature_model(rig)(q.vector())->features).norm(), 1e-6) << trial;
        EXPECT_LT(desired.rate.norm() + desired.acceleration.norm(), 1e-6);
      }
    }
  }
}

TEST(TipGoals, RatesAreTheDerivativesOfTheFeatures) {
  const Rig rig = rig_with(straight_tool());
  TipGoals tips(rig, {});
  tips.follow(joints_at(0, there));
  const Eigen::Vector3d centre_m = *tips.tip_at(there);
  const Trajectory circle = tips.features_of(
      {0, {}, [&](double t) {
         return TipGoal{centre_m + 0.005 * Eigen::Vector3d(std::cos(t), std::sin(t), 0), 1.2 + 0.2 * std::sin(t)};
       }});
  constexpr double h = 1e-3;
  for (double t = 0; t < 6; t += 0.37) {
    const DesiredFeatures now = circle.at(t), before = circle.at(t - h), after = circle.at(t + h);
    const Eigen::Vector4d unit(0.001, 1, 1, 1);
    EXPECT_LT(((after.features - before.features) / (2 * h) - now.rate).cwiseQuotient(unit).norm(), 0.05) << t;
    EXPECT_LT(((after.rate - before.rate) / (2 * h) - now.acceleration).cwiseQuotient(unit).norm(), 0.2) << t;
  }
}

// Whatever the registration is off by: where the image shows the desired features, the true tip lies on its goal in the
// image.
TEST(TipGoals, TheImageClosesWhatTheRegistrationIsOffBy) {
  constexpr std::uint64_t seed = 82;
  Random random(seed);
  for (int trial = 0; trial < 20; ++trial) {
    const Tool tool = trial % 2 ? straight_tool() : placed_tool();
    const Rig rig = rig_with(tool);
    const std::vector<double> wrist_rad(tool.wrist.size(), 0.4);
    const Truth truth{testing::misregistered(rig, random)};
    TipGoals tips(rig, {});
    JointVector q = there;
    const TipGoal goal{truth.tip_at(q, wrist_rad) + 0.003 * Eigen::Vector3d(random.normal(), random.normal(), 0)};
    const Trajectory features = tips.features_of(tip_set_point(goal, ""));
    const auto off_px = [&] {
      return (rig.camera.ideal_from_point(truth.tip_at(q, wrist_rad)) - rig.camera.ideal_from_point(goal.position_m))
          .norm();
    };
    // The law brings the seen features to the desired ones.
    double first_px = 0;
    for (int k = 0; k < 60; ++k) {
      const double time_s = k / 30.0;
      tips.follow(joints_at(time_s, q, wrist_rad));
      const DesiredFeatures desired = features.at(time_s);
      for (int i = 0; i < 5; ++i) {
        const Eigen::Vector4d left = desired.features - truth.image_of(q, 0, rig).features;
        q = JointVector::from_vector(q.vector() + feature_model(rig)(q.vector())->jacobian.inverse() * left);
      }
      if (k == 0) first_px = off_px();
      tips.see(truth.image_of(q, time_s, rig), *rig.instruments[0].camera_from_rcm);
    }
    EXPECT_GT(first_px, 0.3) << "seed " << seed << ", trial " << trial;
    EXPECT_LT(off_px(), 0.02) << "seed " << seed << ", trial " << trial << ", first " << first_px;
  }
}

TEST(TipGoals, FollowTheWrist) {
  const Rig rig = rig_with(placed_tool());
  const FeatureModel model = feature_model(rig);
  TipGoals tips(rig, {});
  std::optional<Trajectory> features;
  Eigen::Vector3d goal_m;
  for (int k = 0; k <= 120; ++k) {
    const double time_s = k / 120.0;
    const std::vector<double> wrist_rad{0.2 + 0.5 * time_s, -0.1};
    tips.follow(joints_at(time_s, there, wrist_rad));
    if (k == 0) goal_m = Truth{rig}.tip_at(there, wrist_rad), features = tips.features_of(tip_set_point({goal_m}, ""));
    const DesiredFeatures now = features->at(time_s);
    const auto q = tips.configuration({goal_m});
    ASSERT_TRUE(q);
    EXPECT_LT((Truth{rig}.tip_at(*q, wrist_rad) - goal_m).norm(), 1e-12);
    EXPECT_LT((model(q->vector())->features - now.features).norm(), 1e-9);
    if (k < 60) continue;
    tips.follow(joints_at(time_s, there, {wrist_rad[0] + 0.5 * 1e-3, -0.1}));  // no later: it does not count
    const auto later = tips.configuration({goal_m}, 1e-3);
    const Eigen::Vector4d rate = (model(later->vector())->features - now.features) / 1e-3;
    EXPECT_LT((rate - now.rate).cwiseQuotient(Eigen::Vector4d(1e-3, 1, 1, 1)).norm(), 0.3);
    EXPECT_GT(now.rate.norm(), 5);
  }
}

// As an image shows it that comes 0.3 s late: to move on by the speed of now errs by 0.28 rad.
TEST(TipGoals, KnowTheWristOfTheLastSecondByItsReadings) {
  TipGoals tips(rig_with(placed_tool()), {});
  EXPECT_FALSE(tips.past_wrist_rad(0.1));
  const auto pitch_rad = [](double time_s) { return 0.6 * MinimumJerk::position(std::clamp(time_s / 0.5, 0.0, 1.0)); };
  Random random(84);
  for (int k = 0; k <= 240; ++k) {
    const double time_s = k / 120.0;
    tips.follow(joints_at(time_s, there, {pitch_rad(time_s), -0.1 + 1e-3 * random.normal()}));
    for (const double ago_s : {0.0, 0.103, 0.3, 0.9}) {
      const auto then = tips.past_wrist_rad(ago_s);
      ASSERT_TRUE(then);
      EXPECT_NEAR(then->at(0), pitch_rad(time_s - ago_s), 1e-3) << time_s << ' ' << ago_s;
      EXPECT_NEAR(then->at(1), -0.1, 5e-3);  // noise stays as it is read
    }
  }
  EXPECT_EQ(tips.past_wrist_rad(-0.01), tips.wrist_rad(0));  // the last one
  tips.follow(joints_at(2.01, there, {NAN, -0.1}));
  EXPECT_FALSE(tips.past_wrist_rad(0.1));
}

// So that the loop holds.
TEST(TipGoals, AreNotANumberWhereTheWristIsNotKnown) {
  const Rig rig = rig_with(placed_tool());
  TipGoals tips(rig, {});
  const std::vector<double> usual{0.2, -0.1}, jumped{1.6, -0.1};
  const Trajectory features = tips.features_of(tip_set_point({Truth{rig}.tip_at(there, usual)}, ""));
  const struct {
    std::vector<double> wrist_rad;
    bool known;
  } readings[] = {{usual, true},  {usual, true},  {{NAN, -0.1}, false}, {usual, true},           {{}, false},
                  {{0.2}, false}, {usual, true},  {jumped, false},      {jumped, false},         {jumped, true},
                  {usual, false}, {jumped, true}, {jumped, true},       {{1.6, INFINITY}, false}};
  for (int k = 0; const auto& [wrist_rad, known] : readings) {
    const double time_s = k++ / 120.0;
    tips.follow(joints_at(time_s, there, wrist_rad));
    EXPECT_EQ(tips.wrist_rad(0).has_value(), known) << k;
    EXPECT_EQ(features.at(time_s).features.allFinite(), known) << k;
  }
}

TEST(TipGoals, AFreeRollStaysWhereTheImageHasItSinceTheStart) {
  const Rig rig = rig_with(straight_tool());
  TipGoals tips(rig, {});
  JointVector misread = there;
  misread.psi_rad += 0.2 + two_pi;  // the arm's roll is not the image's, and a turn farther
  const Trajectory features = tips.features_of(tip_set_point({Truth{rig}.tip_at(there, {})}, ""));
  for (int k = 0; k < 5; ++k) {
    tips.follow(joints_at(k, misread));
    features.at(k);
    tips.see(Truth{rig}.image_of(there, k, rig), *rig.instruments[0].camera_from_rcm);
  }
  JointVector turned = there;
  turned.psi_rad += 0.1;  // a disturbance: the roll does not give way to it
  tips.see(Truth{rig}.image_of(turned, 6, rig), *rig.instruments[0].camera_from_rcm);
  const auto psi_rad = [&] { return tips.configuration({Truth{rig}.tip_at(there, {})})->psi_rad; };
  EXPECT_NEAR(psi_rad(), there.psi_rad + two_pi, 1e-6);
  JointState rolled = joints_at(7, misread);  // by a hand while the arm was held
  rolled.q.psi_rad += 0.6, turned.psi_rad = there.psi_rad + 0.6;
  rolled.started = true;
  tips.follow(rolled);
  features.at(7);
  EXPECT_NEAR(psi_rad(), rolled.q.psi_rad, 1e-6);
  tips.see(Truth{rig}.image_of(turned, 7, rig), *rig.instruments[0].camera_from_rcm);
  EXPECT_NEAR(psi_rad(), turned.psi_rad + two_pi, 1e-6);
}

TEST(TipGoals, AFreeRollEndsTheTurnOfTheGoalBefore) {
  const Rig rig = rig_with(straight_tool());
  TipGoals tips(rig, {});
  const Eigen::Vector3d there_m = Truth{rig}.tip_at(there, {});
  TipGoal goal{there_m, there.psi_rad + 1.3};
  const Trajectory features = tips.features_of({0, {}, [&](double) { return goal; }});
  JointVector turning = there;
  const auto go_on = [&](double time_s, double turned_rad) {
    turning.psi_rad = there.psi_rad + turned_rad;
    tips.follow(joints_at(time_s, turning));
    features.at(time_s);
    tips.see(Truth{rig}.image_of(turning, time_s, rig), *rig.instruments[0].camera_from_rcm);
    return tips.configuration(goal)->psi_rad - there.psi_rad;
  };
  EXPECT_NEAR(go_on(0, 0), 1.3, 1e-6);
  EXPECT_NEAR(go_on(1, 0.2), 1.3, 1e-6);
  goal = {there_m};
  EXPECT_NEAR(go_on(2, 0.3), 0.3, 1e-6);
  EXPECT_NEAR(go_on(3, 0.4), 0.3, 1e-6);  // a disturbance
}

class Refusals : public ::testing::Test {
 protected:
  Refusals() {
    controller.window = image_window(rig.camera, 20);
    joints.follows = true;
  }
  std::string refused(const TipGoal& goal) const {
    return testing::input_error([&] {
      refuse_goal({0, {}, [goal](double) { return goal; }}, 1, rig, rig.instruments[0].camera_from_rcm, controller,
                  joints, "--tip");
    });
  }
  static std::optional<Eigen::Vector3d> nearest_in(const std::string& text) {
    constexpr std::string_view begin = "reached is ";
    const std::size_t at = text.find(begin);
    Eigen::Vector3d place;
    if (at == std::string::npos ||
        std::sscanf(text.c_str() + at + begin.size(), "%lf,%lf,%lf", &place[0], &place[1], &place[2]) != 3)
      return std::nullopt;
    return place;
  }

  Rig rig = rig_with(straight_tool());
  ControllerConfig controller;
  JointState joints = joints_at(0, there);
  Eigen::Vector3d here_m = Truth{rig}.tip_at(there, {});
};

TEST_F(Refusals, NothingInReachIsRefused) {
  EXPECT_EQ(refused({here_m}), "");
  EXPECT_EQ(refused({here_m + Eigen::Vector3d(0.004, -0.003, 0.005)}), "");
  EXPECT_EQ(refused({here_m, there.psi_rad + 0.3}), "");
}

// In words, with the nearest place, which is not refused, and to which no other is much nearer.
TEST_F(Refusals, GoalsOutOfReachHaveTheNearestThatIsNot) {
  const JointLimits& limits = controller.limits;
  JointVector deep = there;
  deep.rho_m = limits.upper[2] + 0.02;
  struct {
    TipGoal goal;
    std::string why;
  } const goals[] = {{{Truth{rig}.tip_at(deep, {})}, "limits.upper rho_m"},
                     {{{0.01, 0.01, -0.1}}, "lies behind the camera"},
                     {{{0.3, 0, 0.15}}, ""},
                     {{rig.instruments[0].camera_from_rcm->translation}, "too near to the RCM"}};
  const std::string roll = refused({here_m, limits.upper[3] + 0.2});
  EXPECT_NE(roll.find("limits.upper psi_rad"), std::string::npos) << roll;
  EXPECT_NE(roll.find("; rolls of -1.571 to 4 rad can be reached"), std::string::npos) << roll;
  Random random(83);
  for (const auto& [goal, why] : goals) {
    const std::string text = refused(goal);
    SCOPED_TRACE(text);
    EXPECT_NE(text.find("--tip: can't be followed at 0.00 s: "), std::string::npos);
    EXPECT_NE(text.find(why), std::string::npos);
    const auto nearest = nearest_in(text);
    ASSERT_TRUE(nearest);
    const double away_m = (*nearest - goal.position_m).norm();
    TipGoal moved{*nearest};
    EXPECT_EQ(refused(moved), "");
    int nearer = 0;
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector3d by(random.normal(), random.normal(), random.normal());
      moved.position_m = *nearest + 0.003 * by;
      nearer += (moved.position_m - goal.position_m).norm() < away_m - 3e-4 && refused(moved).empty();
    }
    EXPECT_EQ(nearer, 0);
  }
  EXPECT_EQ(nearest_in(refused({{NAN, 0, 0.1}})), std::nullopt);
  EXPECT_NE(refused({{NAN, 0, 0.1}}).find("not finite"), std::string::npos);
}

// Any azimuth is possible, as after a calliper.
TEST_F(Refusals, ATipThatABentWristLeavesOpenIsNeitherAcceptedNorFollowed) {
  Tool tool = needle_driver();
  tool.place.emplace().base_in_marker_m = {0, 0, 0.04};
  tool.place->covariance(3, 3) = pi * pi / 3;
  rig.instruments[0].tool = tool;
  const std::vector<double> straight_rad{0, 0}, bent_rad{0.8, 0};
  const TipGoal goal{Truth{rig}.tip_at(there, straight_rad)};
  joints.wrist_rad = straight_rad;
  EXPECT_EQ(refused(goal), "");
  joints.wrist_rad = bent_rad;
  EXPECT_NE(refused(goal).find("known to 25 mm: lapservo calibrate tip --touch"), std::string::npos) << refused(goal);

  TipGoals tips(rig, {});
  tips.follow(joints_at(0, there, straight_rad));
  const Trajectory features = tips.features_of(tip_set_point(goal, ""));
  const Eigen::Vector4d followed = features.at(0).features;
  EXPECT_LT((followed - feature_model(rig)(there.vector())->features).norm(), 1e-6);
  EXPECT_EQ(features.at(0).hold, HoldReason::none);
  tips.follow(joints_at(1, there, bent_rad));
  EXPECT_EQ(features.at(1).hold, HoldReason::tip_open);
  EXPECT_EQ(features.at(1).features, followed);
  EXPECT_TRUE(features.at(1).rate.isZero());
  tips.follow(joints_at(2, there, straight_rad));
  EXPECT_EQ(features.at(2).hold, HoldReason::none);
  const TipGoal at_rcm{rig.instruments[0].camera_from_rcm->translation};
  EXPECT_EQ(tips.features_of(tip_set_point(at_rcm, "")).at(2).hold, HoldReason::tip_unreachable);
  tips.use({});  // the loop has its own reason
  EXPECT_EQ(features.at(2).hold, HoldReason::none);
}

// The seam faces the camera at psi -1.571 and a turn on: d jumps there, and the shaft turns the other way round.
TEST_F(Refusals, ARollCountsByTheTurnToWhichTheFeaturesLead) {
  const struct {
    double psi_rad, roll_rad;
    std::string why;
  } goals[] = {{1.2, -1.5, ""},
               {1.2, -1.8, "limits.upper psi_rad 4: needs 4.483"},  // within the limits, and not reached
               {1.2, two_pi - 1.5, ""},
               {1.2, -1.571, ""},  // the ends that are said
               {1.2, 4, ""},
               {3.5, -1, ""},  // by the longer way
               {-3, -1.8, ""},
               {-3, 2.5, ""},
               {-3, 1.2, "limits.lower psi_rad -4: needs -5.083"}};
  for (const auto& [psi_rad, roll_rad, why] : goals) {
    joints.q.psi_rad = psi_rad;
    const std::string text = refused({here_m, roll_rad});
    EXPECT_EQ(text.empty(), why.empty()) << text;
    EXPECT_NE(text.find(why), std::string::npos) << text;
  }
  joints.q = there;
  const Trajectory turning{0, {}, [&](double time_s) { return TipGoal{here_m, -1 - 0.1 * time_s}; }};
  const std::string text = testing::input_error(
      [&] { refuse_goal(turning, 10, rig, rig.instruments[0].camera_from_rcm, controller, joints, "--trajectory"); });
  EXPECT_NE(text.find("can't be followed at 5.72 s: the marker's seam faces the camera"), std::string::npos) << text;
  EXPECT_NE(text.find("; rolls of -1.571 to 4 rad can be reached"), std::string::npos) << text;
}

TEST_F(Refusals, SayWhatIsMissing) {
  rig.instruments[0].tool = placed_tool();
  EXPECT_NE(refused({here_m}).find("the arm does not measure wrist_pitch, wrist_yaw"), std::string::npos);
  rig.instruments[0].tool.reset();
  EXPECT_NE(refused({here_m}).find("`tool`"), std::string::npos);
  rig.instruments[0].camera_from_rcm.reset();
  EXPECT_NE(refused({here_m}).find("camera_from_rcm and a method other than uncalibrated"), std::string::npos);
}

}  // namespace lapservo::internal::tip_goals_test
