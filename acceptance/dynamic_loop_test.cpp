#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "acceptance/mujoco_arm.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/random.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::testing {
using namespace internal;
namespace {

/// The decision of one tick, and its result.
struct DynamicTick {
  double time_s = 0;
  ServoDecision decision;
  Eigen::Vector4d error = Eigen::Vector4d::Zero();           ///< true features minus desired, when it began
  Eigen::Vector4d fastest = Eigen::Vector4d::Zero();         ///< of the instrument's joints, until the next
  Eigen::Vector4d setpoint_ahead = Eigen::Vector4d::Zero();  ///< of the measured joints, when it ended
};

/// The servo loop around MuJoCo's arm, with a camera that gives features instead of images: 60 ticks and 30 frames a
/// second, so that a test takes milliseconds.
class DynamicLoop {
 public:
  double latency_s = 0.08;
  MujocoArmConfig arm_config{};
  ControllerConfig controller{};
  Rig rig = paper_test_rig();
  /// Where things really are; what the loop knows is `rig`.
  std::optional<FeatureModel> true_model{};
  Eigen::Vector4d start{0.05, 1.57, 0.064, 1.2};                        ///< measured
  std::function<Eigen::Vector4d(double time_s)> misread = [](double) {  ///< what is added to the measured joints
    return Eigen::Vector4d(Eigen::Vector4d::Zero());
  };
  std::function<void(double time_s, MujocoArm& arm)> meddle = [](double, MujocoArm&) {};
  /// The image from its beginning arrives again and again, from a camera whose noise is known.
  std::optional<Interval> frozen{};
  /// The part of the configuration that an image determines, as where a registration fits.
  bool images_know_q = true;

  std::vector<DynamicTick> run(const Trajectory& trajectory, double duration_s) {
    const FeatureModel model = feature_model(rig), truth = true_model.value_or(model);
    MujocoArm arm(arm_config, start);
    Servo servo(controller, model);
    Random random(1);
    std::deque<ImageMeasurement> on_the_way;
    std::vector<DynamicTick> ticks;
    std::optional<JointPath> path;
    const double period_s = controller.period_s;
    for (long k = 0; static_cast<double>(k) * period_s < duration_s; ++k) {
      DynamicTick tick;
      tick.time_s = static_cast<double>(k) * period_s;
      meddle(tick.time_s, arm);
      const FeatureState seen = truth(arm.true_jp()).value();
      const DesiredFeatures desired = trajectory.at(tick.time_s);
      tick.error = feature_error(seen.features, desired.features);
      if (k % 2 == 0) on_the_way.push_back(exposed(seen, arm.true_jp(), tick.time_s + latency_s, random));
      if (k % 2 == 0) freeze(on_the_way.back());
      ServoInput input;
      input.time_s = tick.time_s;
      input.joints = {tick.time_s, JointVector::from_vector(arm.measured_jp() + misread(tick.time_s)),
                      OperatingState::enabled};
      input.desired = desired;
      while (!on_the_way.empty() && on_the_way.front().time_s <= tick.time_s + 1e-9) {
        input.image = on_the_way.front();
        on_the_way.pop_front();
      }
      tick.decision = servo.step(input);
      if (tick.decision.send) path = servo.path();
      move(arm, path, tick, period_s);
      ticks.push_back(tick);
    }
    return ticks;
  }

 private:
  ImageMeasurement exposed(const FeatureState& seen, const Eigen::Vector4d& q, double stamp_s, Random& random) const {
    const Eigen::Vector4d sigma(4e-4, 0.15, 0.15, 0.15);
    ImageMeasurement image;
    image.found = true;
    image.time_s = stamp_s;
    for (int i = 0; i < 4; ++i) image.features[i] = seen.features[i] + sigma[i] * random.normal();
    for (int i = 0; i < 4; ++i) image.ends_px[i] = seen.ends_px[i] + 0.15 * random.normal();
    image.covariance = sigma.cwiseAbs2().asDiagonal();
    if (images_know_q) image.q = q;
    return image;
  }
  void freeze(ImageMeasurement& image) {
    const bool repeats = frozen && frozen->contains(image.time_s) && shown_;
    const double stamp_s = image.time_s;
    if (!repeats) shown_ = image;
    image = *shown_;
    image.time_s = stamp_s;
    if (repeats) image.repetition = Repetition::of_a_noisy_camera;
  }
  static void move(MujocoArm& arm, const std::optional<JointPath>& path, DynamicTick& tick, double period_s) {
    constexpr int parts = 16;
    for (int i = 1; i <= parts; ++i) {
      if (path) arm.servo_jp(path->at(tick.time_s + period_s * i / parts).position);
      arm.step(period_s / parts);
      tick.fastest = tick.fastest.cwiseMax(arm.true_velocity().cwiseAbs());
    }
    tick.setpoint_ahead = arm.setpoint() - arm.measured_jp();
  }

  std::optional<ImageMeasurement> shown_{};
};

/// Root mean square of the errors from `from_s` on.
Eigen::Vector4d rms_from(const std::vector<DynamicTick>& ticks, double from_s) {
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  int count = 0;
  for (const DynamicTick& tick : ticks)
    if (tick.time_s >= from_s) squares += tick.error.cwiseAbs2(), ++count;
  return (squares / count).cwiseSqrt();
}

const Trajectory papers = sinusoids(paper_sinusoids());
constexpr double delay_s = 0.08;

bool holds(const DynamicTick& tick) {
  return tick.decision.control.action == ControlAction::hold;
}

double worst_delay_error_s(const std::vector<DynamicTick>& ticks, double from_s) {
  double worst_s = 0;
  for (const DynamicTick& tick : ticks)
    if (tick.time_s >= from_s) worst_s = std::max(worst_s, std::abs(tick.decision.control.delay_s - delay_s));
  return worst_s;
}

TEST(DynamicLoop, CrossesFrictionAtReversals) {
  DynamicLoop sticking, smooth;
  smooth.arm_config.friction.setZero();
  for (DynamicLoop* loop : {&sticking, &smooth}) {
    const Eigen::Vector4d rms = rms_from(loop->run(papers, 20), 5);
    EXPECT_LE(rms[0], 0.3e-3);
    EXPECT_LE(rms[1], 0.15);  // r: without crossing friction 0.50
    EXPECT_LE(rms.tail<2>().maxCoeff(), 0.2);
  }
}

// However long; before it has ever moved, before it has gone both ways, at speed and when it has settled.
TEST(DynamicLoop, IsNotFastWhenABlockedJointIsReleased) {
  for (int joint = 0; joint < 4; ++joint) {
    for (const double begin_s : {0.0, 0.3, 1.3, 4.0}) {
      for (const double duration_s : {0.2, 0.7, 3.0}) {
        SCOPED_TRACE(::testing::Message() << joint << " blocked from " << begin_s << " for " << duration_s);
        DynamicLoop loop;
        bool blocked = false;
        loop.meddle = [&](double time_s, MujocoArm& arm) {
          const bool wanted = time_s >= begin_s && time_s < begin_s + duration_s;
          if (wanted == blocked) return;
          wanted ? arm.block(joint) : arm.release(joint);
          blocked = wanted;
        };
        const auto ticks = loop.run(papers, begin_s + duration_s + 4);
        Eigen::Vector4d fastest = Eigen::Vector4d::Zero();
        for (const DynamicTick& tick : ticks) fastest = fastest.cwiseMax(tick.fastest);
        EXPECT_LE(fastest.cwiseQuotient(loop.controller.limits.rate).maxCoeff(), 1.2);
        EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
      }
    }
  }
}

// At any time of the trajectory: where its joints are fast, and where they turn and stand still on their friction.
TEST(DynamicLoop, HoldsWithin100MsOfAPictureThatFreezes) {
  for (int k = 0; k < 20; ++k) {
    DynamicLoop loop;
    const double begin_s = 6 + 0.37 * k, end_s = begin_s + 1;
    loop.frozen = Interval{begin_s, end_s};
    const auto ticks = loop.run(papers, end_s + 3);
    for (const DynamicTick& tick : ticks) {
      if (tick.time_s > begin_s + 0.1 && tick.time_s < end_s - 1e-9) {
        EXPECT_EQ(tick.decision.control.reason, HoldReason::frozen_image) << begin_s << ' ' << tick.time_s;
      }
    }
    EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
  }
}

TEST(DynamicLoop, SaysThatAJointDoesNotFollow) {
  DynamicLoop loop;
  loop.meddle = [](double time_s, MujocoArm& arm) {
    if (std::abs(time_s - 4) < 1e-3) arm.block(2);
  };
  const auto ticks = loop.run(papers, 8);
  EXPECT_TRUE(std::any_of(ticks.begin(), ticks.end(), [](const DynamicTick& tick) {
    return tick.time_s > 4 && tick.decision.control.reason == HoldReason::not_following;
  }));
}

// Holds until an image gives the instrument's place; the rest is the desired motion of that time.
TEST(DynamicLoop, AnEncoderThatIsSetIsFoundOut) {
  for (int joint = 0; joint < 4; ++joint) {
    for (const double by : {0.01, 0.03}) {
      SCOPED_TRACE(::testing::Message() << joint << " by " << by);
      DynamicLoop loop;
      loop.misread = [&](double time_s) -> Eigen::Vector4d {
        const Eigen::Vector4d size(1, 1, 0.1, 4);
        return (time_s >= 6 ? by : 0) * size[joint] * Eigen::Vector4d::Unit(joint);
      };
      const auto ticks = loop.run(papers, 10);
      EXPECT_LE(worst_delay_error_s(ticks, 5), 0.005);
      for (const DynamicTick& tick : ticks) {
        if (tick.time_s < 6) continue;
        EXPECT_LE(tick.error.tail<3>().cwiseAbs().maxCoeff(), 8) << tick.time_s;
      }
      EXPECT_FALSE(holds(ticks.back()));
      EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
    }
  }
}

// The first guess is 100 ms.
TEST(DynamicLoop, DoesNotOvershootWhileTheDelayIsUnknown) {
  for (const double latency_s : {0.0, 0.1, 0.2}) {
    SCOPED_TRACE(latency_s);
    DynamicLoop loop;
    loop.latency_s = latency_s;
    const auto ticks = loop.run(set_point(paper_sinusoids().offset), 6);
    const Eigen::Vector4d first = ticks.front().error;
    for (const DynamicTick& tick : ticks) {
      EXPECT_GE(tick.error[0] * std::copysign(1, first[0]), -1e-3) << tick.time_s;
      EXPECT_GE(tick.error[1] * std::copysign(1, first[1]), -1) << tick.time_s;
    }
    EXPECT_LE(rms_from(ticks, 5).tail<3>().maxCoeff(), 1);
  }
}

// Its servos are a quarter as stiff: it hangs below its setpoints by more than the following-error limit.
TEST(DynamicLoop, AnArmThatHangsLowIsNotTakenForBlocked) {
  DynamicLoop loop;
  loop.arm_config.proportional_gain[2] /= 4;
  loop.arm_config.derivative_gain[2] /= 2;
  loop.arm_config.friction[2] /= 4;
  const auto ticks = loop.run(papers, 10);
  EXPECT_LE(rms_from(ticks, 6).tail<3>().maxCoeff(), 1);
}

}  // namespace
}  // namespace lapservo::testing
