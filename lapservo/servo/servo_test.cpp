#include "lapservo/servo/servo.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/control/calibration_motion.h"
#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/registration_watch.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::servo_test {

const Eigen::Vector4d start(0.05, 1.57, 0.064, 1.2);

ControllerConfig without_delay() {
  ControllerConfig config;
  config.observer.delay_s = 0;
  return config;
}

// An arm that reaches each setpoint at once, before an endoscope that may move; its images are tracked with what the
// servo goes by, and come a tick after they were exposed.
class MovedEndoscope {
 public:
  explicit MovedEndoscope(ControllerConfig config = without_delay())
      : period_s_(config.period_s), servo_(config, rig_) {
    aim({0.03, 0.02, 0.004, 0.2});
  }
  void aim(const Eigen::Vector4d& from_start) {
    desired_.features = feature_model(rig_)(start + from_start).value().features;
  }
  void push(const Eigen::Vector4d& by) { q_ += by; }
  const Eigen::Vector4d& q() const { return q_; }
  void move() { camera_from_rcm_.translation += Eigen::Vector3d(0.004, -0.006, 0.01); }

  ServoDecision step() {
    if (!silent) joints_ = {time_s_, JointVector::from_vector(q_ + encoder_off)};
    if (broken_joints) joints_.q.phi_rad = NAN;
    ServoInput input{time_s_, {joints_.time_s, joints_.q, state, true, started}, std::nullopt, desired_, {}};
    if (steps_++ % image_every == 0) input.image = image();
    time_s_ += period_s_;
    last_ = servo_.step(input);
    q_exposed_ = q_;
    started = false;
    if (last_.send) q_ = last_.control.setpoint.position - encoder_off;
    return last_;
  }
  ServoDecision steps(int count) {
    for (int i = 0; i < count; ++i) step();
    return last_;
  }
  // False: it did not come to that in 15 s.
  template <class Condition>
  bool until(const Condition& condition) {
    for (double end_s = time_s_ + 15; time_s_ < end_s;)
      if (condition(step())) return true;
    return false;
  }
  // As somebody does who swings all joints until that is enough; nothing else moves them.
  bool until_measured() {
    const Eigen::Vector4d from = q_;
    const JointMotion motion = swing_motion(from, JointLimits(), 0.7, 12);
    const double begin_s = time_s_ + 0.5;
    return until([&](const ServoDecision& decision) {
      EXPECT_FALSE(decision.send);
      EXPECT_TRUE(decision.release);
      if (decision.control.reason == HoldReason::endoscope_measured) return true;
      q_ = motion.at(time_s_ - begin_s);
      return false;
    });
  }
  // After 60 ticks of following.
  void move_until_released() {
    steps(60);
    move();
    ASSERT_TRUE(until([](const ServoDecision& decision) { return decision.release; }));
  }
  void move_until_measured() {
    move_until_released();
    ASSERT_TRUE(until_measured());
  }
  void expect_started(int registration) {
    EXPECT_EQ(start_anew().registration, registration);
    EXPECT_LT(steps(360).control.error.norm(), 0.1);
  }
  ServoDecision start_anew() {
    started = true;
    return step();
  }

  OperatingState state = OperatingState::enabled;
  Eigen::Vector4d encoder_off = Eigen::Vector4d::Zero(), seen_off = Eigen::Vector4d::Zero();
  bool visible = true, registered = true, broken_joints = false, passes_rcm = true, tells_marker = true, frozen = false,
       started = false, silent = false;
  int image_every = 1;

 private:
  ImageMeasurement image() {
    if (!frozen) q_shown_ = q_exposed_;
    ImageMeasurement image;
    image.time_s = time_s_ - period_s_;
    image.registration = last_.registration;
    if (frozen) image.repetition = Repetition::possible_at_rest;
    if (!visible) return image;
    const auto& believed = steps_ > 1 ? last_.camera_from_rcm : rig_.instruments[0].camera_from_rcm;
    const Marker& marker = rig_.instruments[0].marker;
    const Eigen::Vector4d q = q_shown_ + seen_off;
    Rigid3 unrolled = camera_from_rcm_ * rcm_from_unrolled(JointVector::from_vector(q));
    if (!passes_rcm) unrolled.rotation = rotation_by({0, 0, 0.15}) * unrolled.rotation;
    const auto edges_px = centre_line(rig_.camera, marker, unrolled, q[3]).value().ideal_px;
    const auto rcm_px = believed ? projected_rcm_px(rig_.camera, *believed) : std::nullopt;
    const Features f = features_of(edges_px, rcm_px);
    image.found = believed.has_value();
    image.features << f.s_rad, f.r_px.value_or(0), f.l_px, f.d_px;
    image.covariance *= 1e-4;
    image.ends_px << edges_px[0], edges_px[3];
    const bool fits = believed && (believed->translation - camera_from_rcm_.translation).norm() < 1e-3;
    if (fits && passes_rcm && registered) image.q = q;
    const Rigid3 pose = camera_from_marker(marker, unrolled, q[3]);
    if (tells_marker) image.camera_from_marker = pose;
    return image;
  }

  Rig rig_ = testing::paper_test_rig();
  double period_s_;
  Servo servo_;
  Rigid3 camera_from_rcm_ = *rig_.instruments[0].camera_from_rcm;
  DesiredFeatures desired_;
  ServoDecision last_;
  JointReading joints_;
  Eigen::Vector4d q_ = start, q_exposed_ = start, q_shown_ = start;
  double time_s_ = 0;
  int steps_ = 0;
};

TEST(Servo, SaysThatImagesContradictTheRegistration) {
  MovedEndoscope world;
  world.tells_marker = false;
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
  passes.rcm = Observation::Rcm{};
  const auto frames = [](RegistrationWatch& watch, const std::vector<Observation>& observations, int count) {
    int said = 0;
    for (int i = 0; i < count; ++i) said += watch.add(observations).has_value();
    return said;
  };
  RegistrationWatch never;
  EXPECT_EQ(frames(never, {misses}, 50), 0);  // wrong all along: not moved
  RegistrationWatch watch;
  EXPECT_EQ(frames(watch, {passes}, 20) + frames(watch, {misses}, 2) + frames(watch, {lost}, 30), 0);
  EXPECT_EQ(frames(watch, {misses}, 2), 0);
  EXPECT_EQ(watch.add(std::vector{misses}), 34) << "frames after the first, in all";
  EXPECT_EQ(frames(watch, {misses}, 50) + frames(watch, {passes}, 20), 0);
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

TEST(Servo, SendsNothingToAnArmThatIsNotEnabledAndStartsAnewWhereItIs) {
  MovedEndoscope world;
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
  world.encoder_off[0] = 0.5;  // one reading that no arm reaches within a tick, just before it moves again
  world.step();
  world.encoder_off[0] = 0;
  world.state = OperatingState::enabled;
  world.steps(3);
  EXPECT_LT((world.q() - there).norm(), 0.01);
  EXPECT_LT(world.steps(300).control.error.norm(), 0.05);
}

TEST(Servo, AMeasuredJointThatIsNotANumberLeavesEverythingFinite) {
  MovedEndoscope world;
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

TEST(Servo, DoesNotMoveWherePsiIsMeasuredElsewhere) {
  for (const double by_rad : {1.5708, -1.5708, 3.1}) {
    MovedEndoscope world;
    world.tells_marker = false;
    world.seen_off[3] = by_rad;
    const Eigen::Vector4d before = world.q();
    const ServoDecision decision = world.steps(60);
    EXPECT_EQ(decision.control.reason, HoldReason::psi_contradicted);
    EXPECT_EQ(world.q(), before);
  }
  MovedEndoscope world;
  world.tells_marker = false;
  world.seen_off[3] = two_pi - 0.1;  // whole turns are the arm's own business
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
    ControllerConfig config = without_delay();
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

TEST(MovedEndoscope, ReleasesTheArmUntilItIsMeasuredAndStarted) {
  MovedEndoscope world;
  EXPECT_EQ(world.steps(60).registration, 0);
  world.move();
  const ServoDecision moved = world.steps(2);
  EXPECT_EQ(moved.registration, 1);
  EXPECT_TRUE(moved.release && !moved.send);
  EXPECT_EQ(world.start_anew().control.reason, HoldReason::endoscope_moved);  // where it stands is not known yet
  ASSERT_TRUE(world.until_measured());
  const ServoDecision measured = world.steps(600);
  EXPECT_EQ(measured.control.reason, HoldReason::endoscope_measured);
  EXPECT_TRUE(measured.release && !measured.send && !measured.camera_from_rcm);
  const ServoDecision started = world.start_anew();
  EXPECT_EQ(started.registration, 2);
  EXPECT_FALSE(started.release);
  EXPECT_LT(world.steps(360).control.error.norm(), 0.1);
}

TEST(MovedEndoscope, IsMeasuredAnewAlsoWhenItMovesAgainBeforeAnImageAgreed) {
  MovedEndoscope world;
  world.move_until_measured();
  EXPECT_EQ(world.start_anew().registration, 2);
  world.passes_rcm = false;
  EXPECT_EQ(world.steps(2).registration, 3);
  world.passes_rcm = true;
  ASSERT_TRUE(world.until_measured());
  world.expect_started(4);
}

TEST(MovedEndoscope, IsNotGoneByWhereItMovedAgainBeforeTheStart) {
  MovedEndoscope world;
  world.move_until_measured();
  world.move();
  world.steps(2);
  const ServoDecision refused = world.start_anew();
  EXPECT_EQ(refused.control.reason, HoldReason::endoscope_moved);
  EXPECT_TRUE(refused.release);
  ASSERT_TRUE(world.until_measured());
  world.expect_started(2);
}

TEST(MovedEndoscope, IsMeasuredByCamerasOfAnyRate) {
  ControllerConfig config = without_delay();
  config.stale_after_s = 0.2;
  MovedEndoscope slow(config);
  slow.image_every = 5;
  slow.move_until_measured();
  config.period_s = 1.0 / 240;
  MovedEndoscope(config).move_until_measured();
}

// As an arm is that is led by hand; and whoever hides the marker for a while goes on afterwards.
TEST(MovedEndoscope, IsMeasuredWhileTheArmIsNotEnabled) {
  MovedEndoscope world;
  world.move_until_released();
  world.state = OperatingState::disabled;
  world.visible = false;
  world.steps(200);
  world.visible = true;
  ASSERT_TRUE(world.until_measured());
  EXPECT_EQ(world.start_anew().control.reason, HoldReason::arm_not_enabled);
  world.state = OperatingState::enabled;
  EXPECT_LT(world.steps(360).control.error.norm(), 0.1);
}

TEST(MovedEndoscope, IsNotWhatHidesTheMarkerNowAndThen) {
  MovedEndoscope world;
  world.steps(60);
  for (int i = 0; i < 10; ++i) {
    world.passes_rcm = false;
    world.step();
    world.passes_rcm = true, world.visible = false;
    world.step();
    world.visible = true;
  }
  EXPECT_EQ(world.steps(2).registration, 0);
  world.passes_rcm = false;
  EXPECT_EQ(world.steps(2).registration, 1);
}

TEST(MovedEndoscope, IsNotMeasuredByATrackerThatTellsNoMarker) {
  MovedEndoscope world;
  world.tells_marker = false;
  world.steps(60);
  world.seen_off[0] = 0.1;
  EXPECT_EQ(world.steps(20).registration, 0);
}

// A camera without noise might show an arm at rest for the longest delay that an image may have.
TEST(MovedEndoscope, IsNoPictureThatFreezesWhenTheArmStarts) {
  ControllerConfig fast = without_delay();
  fast.limits.rate *= 4, fast.limits.acceleration *= 4;
  for (const auto& [config, after] : {std::pair(without_delay(), 30), {fast, 2}, {fast, 8}, {fast, 15}}) {
    SCOPED_TRACE(after);
    MovedEndoscope world(config);
    world.aim(Eigen::Vector4d::Zero());
    world.steps(60);
    world.aim({0.35, 0, 0, 0});
    world.steps(after);
    world.frozen = true;
    EXPECT_EQ(world.steps(60).control.reason, HoldReason::frozen_image);
    world.frozen = false;
    EXPECT_EQ(world.steps(60).registration, 0);
  }
}

// As a ramp of 20 degrees in 0.6 s looks, of which each image shows a little.
TEST(MovedEndoscope, IsHeldFromTheFirstImageThatMovesUntilItIsCertain) {
  MovedEndoscope world;
  world.steps(60);
  for (int k = 0; world.steps(0).registration == 0; ++k) {
    ASSERT_LT(k, 10);
    world.seen_off[0] += 0.005;
    EXPECT_EQ(world.step().control.reason, HoldReason::endoscope_moved);
  }
}

TEST(MovedEndoscope, IsNotOneImageThatIsOffOrLost) {
  MovedEndoscope world;
  world.steps(60);
  for (const bool lost_then : {false, true}) {
    world.seen_off[0] = 0.005;
    EXPECT_EQ(world.step().control.action, ControlAction::hold);
    world.seen_off[0] = 0;
    world.visible = !lost_then;
    world.step();
    world.visible = true;
    EXPECT_EQ(world.steps(20).control.action, ControlAction::track);
  }
  EXPECT_EQ(world.steps(60).registration, 0);
}

TEST(MovedEndoscope, IsNoPictureThatRepeats) {
  MovedEndoscope world;
  world.aim(Eigen::Vector4d::Zero());
  world.steps(60);
  world.frozen = true;
  world.seen_off[0] = 0.1;
  EXPECT_EQ(world.steps(10).registration, 0);
}

// Observations before may be of another place than those afterwards.
TEST(MovedEndoscope, IsNotMeasuredByAPictureThatFreezesMeanwhile) {
  MovedEndoscope world;
  world.move_until_measured();
  world.frozen = true;
  EXPECT_EQ(world.steps(2).control.reason, HoldReason::endoscope_measured);
  for (int k = 0; k < 30; ++k) {
    world.push({0.001, 0, 0, 0});
    world.step();
  }
  EXPECT_EQ(world.step().control.reason, HoldReason::frozen_image);
  world.move();
  world.frozen = false;
  EXPECT_EQ(world.start_anew().control.reason, HoldReason::endoscope_moved);
  ASSERT_TRUE(world.until_measured());
  EXPECT_EQ(world.start_anew().registration, 2);
}

TEST(MovedEndoscope, IsNoArmThatMovesWhileItsJointsAreSilent) {
  MovedEndoscope world;
  world.steps(60);
  world.silent = true;
  world.state = OperatingState::paused;
  world.steps(10);
  for (int k = 0; k < 60; ++k) {
    world.push({0.002, 0, 2e-4, 0});
    world.step();
  }
  world.silent = false;
  world.steps(10);
  world.state = OperatingState::enabled;
  const ServoDecision goes_on = world.steps(360);
  EXPECT_EQ(goes_on.registration, 0);
  EXPECT_EQ(goes_on.control.action, ControlAction::track);
  EXPECT_LT(goes_on.control.error.norm(), 0.1);
}

TEST(MovedEndoscope, IsNoEncoderThatIsSetWhileTheArmIsNotEnabled) {
  MovedEndoscope world;
  world.steps(60);
  world.state = OperatingState::paused;
  world.step();
  world.encoder_off = {0.1, -0.05, 0, 0};
  EXPECT_EQ(world.steps(60).registration, 0);
  world.state = OperatingState::enabled;
  EXPECT_EQ(world.steps(120).registration, 0);
}

}  // namespace lapservo::internal::servo_test
