// The loop's step, the supervisor beneath it and an arm, with whatever may happen to them: no joint moves where the
// supervisor's table does not allow it, nor before an image that is newer than the start.

#include <algorithm>
#include <optional>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::supervised_loop_test {

constexpr double period_s = 1.0 / 60;
const Eigen::Vector4d start(0.05, 1.57, 0.064, 1.2), at_rest(1e-4, 1e-4, 5e-5, 1e-4);

SupervisorConfig quick() {
  SupervisorConfig config;
  config.settle_s = 0.1;
  config.max_loop_hold_s = 0.3;
  return config;
}

// Its arm goes where it is sent while it is enabled; its camera sees at once, or shows what was before.
class Room : public Robot, public Clock {
 public:
  explicit Room(const FeatureModel& model) : model_(model), servo_(config(), model) {
    desired_.features = model(start + Eigen::Vector4d(0.03, 0.02, 0.004, 0.2)).value().features;
  }
  static ControllerConfig config() {
    ControllerConfig config;
    config.observer.delay_s = 0;
    return config;
  }
  JointState state() override {
    JointState state{now_, JointVector::from_vector(q), enabled ? OperatingState::enabled : OperatingState::paused};
    state.blocked = blocked;
    return state;
  }
  void send(const JointPath& path) override { path_ = path; }
  double now_s() const override { return now_; }
  void sleep_until(double time_s) override { now_ = time_s; }

  // One tick, as in run().
  void tick(std::optional<double> image_s, bool found, double lasts_s) {
    ServoInput input{now_, arm.state(), std::nullopt, desired_};
    was_armed = arm.armed();
    if (!was_armed) armed_s.reset();
    if (was_armed && !armed_s) armed_s = now_;
    if (image_s) input.image = image_at(*image_s, found);
    if (image_s && found) newest_s = std::max(newest_s, *image_s);
    const ServoDecision decision = servo_.step(input);
    if (decision.send) arm.send(servo_.path());
    arm.tell_loop(decision.control.action == ControlAction::hold ? "held" : "");
    now_ += lasts_s;
    if (!enabled) path_.reset();
    if (path_) q = path_->at(now_).position;
  }
  bool rests() const { return !path_ || path_->at(now_).velocity.isZero(); }
  bool saw_since_arming() const { return armed_s && newest_s >= *armed_s; }

  bool enabled = true, was_armed = false;
  Blocked blocked = Blocked::none;
  Eigen::Vector4d q = start;
  double newest_s = -1;
  std::optional<double> armed_s;
  Supervisor arm{*this, *this, quick()};

 private:
  ImageMeasurement image_at(double time_s, bool found) const {
    const FeatureState seen = model_(q).value();
    ImageMeasurement image{found, time_s, seen.features, 1e-4 * Eigen::Matrix4d::Identity(), seen.ends_px, {}};
    image.q = q;
    return image;
  }

  const FeatureModel& model_;
  Servo servo_;
  DesiredFeatures desired_;
  double now_ = 10;
  std::optional<JointPath> path_;
};

TEST(SupervisedLoop, AfterAStartItWaitsForAnImageThatIsNewer) {
  const FeatureModel model = feature_model(testing::paper_test_rig());
  Room room(model);
  for (int k = 0; k < 20; ++k) room.tick(room.now_s(), true, period_s);
  room.arm.stop(Commander::page);
  for (int k = 0; k < 20; ++k) room.tick(room.now_s(), true, period_s);
  const double last_s = room.now_s() - period_s;
  room.arm.start(Commander::page, room.now_s());
  const Eigen::Vector4d before = room.q;
  room.tick(std::nullopt, false, period_s);
  EXPECT_TRUE(room.arm.armed());
  for (int k = 0; k < 10; ++k) room.tick(last_s, true, period_s);
  EXPECT_EQ(room.q, before);
  for (int k = 0; k < 5; ++k) room.tick(room.now_s(), true, period_s);
  EXPECT_NE(room.q, before);
}

TEST(SupervisedLoop, NoJointMovesWhereNothingAllowsIt) {
  constexpr std::uint64_t seed = 41;
  Random random(seed);
  const auto happens = [&](double probability) { return random.uniform() < probability; };
  const FeatureModel model = feature_model(testing::paper_test_rig());
  long moving = 0;
  for (int sequence = 0; sequence < 1000; ++sequence) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", sequence " << sequence);
    Room room(model);
    Eigen::Vector4d rest = start;
    bool resting = false;
    int held = 0;
    bool camera = true;
    for (int k = 0; k < 60; ++k) {
      if (happens(0.03)) camera = !camera;
      if (happens(room.enabled ? 0.01 : 0.3)) room.enabled = !room.enabled;
      room.blocked = happens(0.01) ? Blocked::busy : Blocked::none;
      if (happens(0.01)) room.arm.stop(static_cast<Commander::Kind>(random.uniform(0, 3)));
      if (happens(0.1))
        room.arm.start(static_cast<Commander::Kind>(random.uniform(0, 3)), room.now_s() - random.uniform(0, 1.2),
                       happens(0.2));
      const double age_s = happens(0.1) ? random.uniform(0, 0.3) : 0;
      room.tick(camera ? std::optional(room.now_s() - age_s) : std::nullopt, happens(0.97),
                happens(0.02) ? random.uniform(0.02, 0.2) : period_s);
      const bool allowed = room.was_armed && room.saw_since_arming();
      held = allowed ? 0 : held + 1;
      moving += allowed && !room.rests();
      if (allowed || !(room.rests() || held > 30)) {
        resting = false;
      } else if (!resting) {
        resting = true, rest = room.q;
      } else {
        const Eigen::Vector4d away = room.q - rest;
        ASSERT_TRUE((away.array().abs() <= at_rest.array()).all()) << k << ": " << away.transpose();
      }
    }
  }
  EXPECT_GT(moving, 2000);
}

}  // namespace lapservo::internal::supervised_loop_test
