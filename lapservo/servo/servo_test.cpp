#include "lapservo/servo/servo.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/registration_watch.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal {
namespace {

constexpr double period_s = 1.0 / 60;
const Eigen::Vector4d start(0.05, 1.57, 0.064, 1.2);

// A loop whose arm goes where it is told at once and whose camera sees at once.
class PerfectWorld {
 public:
  PerfectWorld() : model_(feature_model(testing::paper_test_rig())), servo_(config(), model_) {
    desired_.features = model_(start + Eigen::Vector4d(0.03, 0.02, 0.004, 0.2)).value().features;
  }
  static ControllerConfig config() {
    ControllerConfig config;
    config.observer.delay_s = 0;
    return config;
  }

  ServoDecision step() {
    ServoInput input{time_s_, {time_s_, JointVector::from_vector(q_), state}, std::nullopt, desired_};
    if (sees) {
      const Eigen::Vector4d instrument = q_ + Eigen::Vector4d(0, 0, 0, psi_off_rad);
      const FeatureState state_now = model_(instrument).value();
      input.image = ImageMeasurement{visible,           time_s_, state_now.features, 1e-4 * Eigen::Matrix4d::Identity(),
                                     state_now.ends_px, {}};
      if (registered) input.image->q = instrument;
    }
    if (broken_joints) input.joints.q.phi_rad = std::numeric_limits<double>::quiet_NaN();
    time_s_ += period_s;
    const ServoDecision decision = servo_.step(input);
    if (decision.send && !stuck) q_ = decision.control.setpoint.position;
    return decision;
  }
  ServoDecision steps(int count) {
    ServoDecision last;
    for (int i = 0; i < count; ++i) last = step();
    return last;
  }

  OperatingState state = OperatingState::enabled;
  double psi_off_rad = 0;  ///< of the instrument from the measured joint
  bool sees = true, visible = true, registered = true, broken_joints = false, stuck = false;
  const Eigen::Vector4d& q() const { return q_; }
  void push(const Eigen::Vector4d& by) { q_ += by; }

 private:
  FeatureModel model_;
  Servo servo_;
  DesiredFeatures desired_;
  Eigen::Vector4d q_ = start;
  double time_s_ = 0;
};

TEST(Servo, Tracks) {
  PerfectWorld world;
  const ServoDecision last = world.steps(240);
  EXPECT_EQ(last.control.action, ControlAction::track);
  EXPECT_EQ(last.control.reason, HoldReason::none);
  EXPECT_LT(last.control.error.norm(), 0.01);
}

TEST(Servo, SaysThatImagesContradictTheRegistration) {
  PerfectWorld world;
  EXPECT_FALSE(world.steps(60).registration_contradicted);
  world.registered = false;
  EXPECT_FALSE(world.steps(5).registration_contradicted);
  EXPECT_TRUE(world.steps(5).registration_contradicted);
  world.visible = false;
  EXPECT_TRUE(world.step().registration_contradicted);
  world.visible = world.registered = true;
  EXPECT_FALSE(world.step().registration_contradicted);
}

TEST(RegistrationWatch, SaysOnceThatShaftsMissTheRcmWhichTheyPassed) {
  Observation passes, misses, lost;
  passes.status = misses.status = Status::ok;
  passes.rcm.emplace();
  const auto frames = [](RegistrationWatch& watch, const std::vector<Observation>& observations, int count) {
    int said = 0;
    for (int i = 0; i < count; ++i) said += watch.add(observations);
    return said;
  };
  RegistrationWatch never;
  EXPECT_EQ(frames(never, {misses}, 50), 0);  // wrong all along: not moved
  RegistrationWatch watch;
  EXPECT_EQ(frames(watch, {passes}, 20) + frames(watch, {lost}, 20) + frames(watch, {misses}, 4), 0);
  EXPECT_EQ(frames(watch, {misses}, 50), 1);
  EXPECT_EQ(frames(watch, {passes}, 20), 0);
  EXPECT_EQ(frames(watch, {misses}, 50), 1);
  // One of two: its own registration, not the endoscope.
  Observation other = passes;
  other.instrument = "other";
  RegistrationWatch two;
  EXPECT_EQ(frames(two, {passes, other}, 20) + frames(two, {misses, other}, 20), 0);
  other = lost;
  other.instrument = "other";
  EXPECT_EQ(frames(two, {misses, other}, 20), 1);
}

TEST(Servo, HoldsWithinAPeriodWhenTheMarkerIsLostAndGoesOnWithoutAJump) {
  PerfectWorld world;
  world.steps(10);
  world.visible = false;
  ServoDecision decision = world.step();
  EXPECT_EQ(decision.control.action, ControlAction::hold);
  EXPECT_EQ(decision.control.reason, HoldReason::marker_lost);
  decision = world.steps(60);
  EXPECT_EQ(decision.control.velocity, Eigen::Vector4d::Zero());
  world.visible = true;
  const Eigen::Vector4d before = world.q();
  decision = world.step();
  EXPECT_EQ(decision.control.action, ControlAction::track);
  const JointLimits limits;
  EXPECT_TRUE(
      ((world.q() - before).cwiseAbs().array() <= 0.5 * limits.acceleration.array() * period_s * period_s + 1e-12)
          .all());
}

TEST(Servo, SendsNothingToAnArmThatIsNotEnabledAndStartsAnewWhereItIs) {
  PerfectWorld world;
  world.steps(20);
  for (const OperatingState state : {OperatingState::disabled, OperatingState::paused, OperatingState::fault}) {
    world.state = state;
    const ServoDecision decision = world.step();
    EXPECT_FALSE(decision.send);
    EXPECT_EQ(decision.control.action, ControlAction::hold);
    EXPECT_EQ(decision.control.reason, HoldReason::arm_not_enabled);
  }
  world.push({0.05, -0.05, 0.002, 0.3});  // somebody moves it meanwhile
  world.step();
  const Eigen::Vector4d there = world.q();
  world.state = OperatingState::enabled;
  world.step();
  EXPECT_LT((world.q() - there).norm(), 0.01);
  EXPECT_LT(world.steps(300).control.error.norm(), 0.05);
}

TEST(Servo, AMeasuredJointThatIsNotANumberLeavesEverythingFinite) {
  PerfectWorld world;
  world.steps(10);
  world.broken_joints = true;
  for (int i = 0; i < 30; ++i) {
    const ServoDecision decision = world.step();
    EXPECT_EQ(decision.control.action, ControlAction::hold);
    EXPECT_EQ(decision.control.reason, HoldReason::non_finite);
    EXPECT_TRUE(decision.control.setpoint.position.allFinite());
    EXPECT_TRUE(decision.control.velocity.allFinite());
  }
  world.broken_joints = false;
  EXPECT_LT(world.steps(300).control.error.norm(), 0.01);
}

// An arm that is held back: no wind-up, and it goes on once it has stood still and is free.
TEST(Servo, AnArmThatDoesNotFollowIsLeftAloneUntilItRests) {
  PerfectWorld world;
  world.steps(3);
  world.push({0.3, 0, 0, 0});
  world.stuck = true;
  EXPECT_EQ(world.steps(2).control.reason, HoldReason::wild_joints);  // so far at once: believed once it stays there
  EXPECT_EQ(world.step().control.reason, HoldReason::not_following);
  world.stuck = false;
  EXPECT_LT(world.steps(400).control.error.norm(), 0.05);
}

// Offsets that are off by a quarter turn: said, and nothing is moved.
TEST(Servo, DoesNotMoveWherePsiIsMeasuredElsewhere) {
  for (const double by_rad : {1.5708, -1.5708, 3.1}) {
    PerfectWorld world;
    world.psi_off_rad = by_rad;
    const Eigen::Vector4d before = world.q();
    const ServoDecision decision = world.steps(60);
    EXPECT_EQ(decision.control.reason, HoldReason::psi_contradicted);
    EXPECT_EQ(world.q(), before);
  }
  PerfectWorld world;
  world.psi_off_rad = two_pi - 0.1;  // whole turns are the arm's own business
  EXPECT_LT(world.steps(240).control.error.norm(), 0.05);
}

// An arm that somebody moves, an image half-way between two slow ticks.
TEST(Servo, ReadingsBetweenTicksTellWhereTheJointsWereAtAnImage) {
  constexpr double slow_s = 0.05, reading_s = 0.002;
  const FeatureModel model = feature_model(testing::paper_test_rig());
  const auto q_at = [](double t) {
    return Eigen::Vector4d(start + Eigen::Vector4d(0.05, 0, 0.003, 0.1) * std::sin(6 * t));
  };
  const auto worst_px = [&](bool between) {
    ControllerConfig config = PerfectWorld::config();
    config.period_s = slow_s;
    Servo servo(config, model);
    double worst = 0;
    for (int k = 1; k < 80; ++k) {
      const double t = k * slow_s, exposed_s = t - slow_s / 2;
      ServoInput input{t, {t, JointVector::from_vector(q_at(t)), OperatingState::disabled}, {}, {}, {}};
      for (double s = t - slow_s + reading_s; between && s < t + 1e-9; s += reading_s)
        input.readings.push_back({s, JointVector::from_vector(q_at(s))});
      const FeatureState then = model(q_at(exposed_s)).value(), now = model(q_at(t)).value();
      input.image =
          ImageMeasurement{true, exposed_s, then.features, 1e-4 * Eigen::Matrix4d::Identity(), then.ends_px, {}};
      const auto estimate = servo.step(input).control.estimate;
      if (k > 20) worst = std::max(worst, (estimate.value().features - now.features).tail<3>().cwiseAbs().maxCoeff());
    }
    return worst;
  };
  EXPECT_LT(worst_px(true), worst_px(false) / 5);
}

TEST(Servo, WithoutImagesItHolds) {
  PerfectWorld world;
  world.sees = false;
  EXPECT_EQ(world.steps(5).control.reason, HoldReason::no_image_yet);
  world.sees = true;
  EXPECT_EQ(world.steps(30).control.action, ControlAction::track);
  world.sees = false;
  EXPECT_EQ(world.steps(30).control.reason, HoldReason::stale_image);
}

}  // namespace
}  // namespace lapservo::internal
