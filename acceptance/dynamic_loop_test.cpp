#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "acceptance/mujoco_arm.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/minimum_jerk.h"
#include "lapservo/core/random.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"
#include "lapservo/servo/tip_goals.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::testing::dynamic_loop_test {
using namespace internal;

/// The decision of one tick, and its result.
struct DynamicTick {
  double time_s = 0;
  ServoDecision decision;
  Eigen::Vector4d error = Eigen::Vector4d::Zero();    ///< true features minus desired, when it began
  Eigen::Vector4d fastest = Eigen::Vector4d::Zero();  ///< of the instrument's joints, until the next
  Eigen::Vector3d tip_m = Eigen::Vector3d::Zero();    ///< the true one in the camera's frame, when it began
};

/// The servo loop around MuJoCo's arm, with a camera that gives features instead of images: 60 ticks and 30 frames a
/// second, so that a test takes milliseconds.
class DynamicLoop {
 public:
  double latency_s = 0.08;
  MujocoArmConfig arm_config{};
  ControllerConfig controller{};
  Rig rig = paper_test_rig();
  /// Where things really are, where that is not as `rig` has it, by which the loop goes.
  std::optional<Rig> true_rig{};
  Eigen::Vector4d start{0.05, 1.57, 0.064, 1.2};                        ///< measured
  std::function<Eigen::Vector4d(double time_s)> misread = [](double) {  ///< what is added to the measured joints
    return Eigen::Vector4d(Eigen::Vector4d::Zero());
  };
  std::function<void(double time_s, MujocoArm& arm)> meddle = [](double, MujocoArm&) {};
  std::function<std::vector<double>(double time_s)> wrist_rad = [](double) { return std::vector<double>(); };

  std::vector<DynamicTick> run(const Trajectory& trajectory, double duration_s) {
    const Rig scene = true_rig.value_or(rig);
    const FeatureModel model = feature_model(rig), truth = feature_model(scene);
    TipGoals tips(rig, controller.scales);
    const Trajectory features = tips.features_of(trajectory);
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
      JointState joints{tick.time_s, JointVector::from_vector(arm.measured_jp() + misread(tick.time_s)),
                        OperatingState::enabled};
      joints.wrist_rad = wrist_rad(tick.time_s);
      tips.follow(joints);
      const Rigid3 camera_from_marker = lapservo::camera_from_marker(
          scene.instruments[0].marker, *scene.instruments[0].camera_from_rcm, JointVector::from_vector(arm.true_jp()));
      if (rig.instruments[0].tool)
        tick.tip_m =
            camera_from_marker * tip_in_marker(*rig.instruments[0].tool, joints.wrist_rad).marker_from_tip.translation;
      const DesiredFeatures desired = features.at(tick.time_s);
      tick.error = feature_error(seen.features, desired.features);
      if (k % 2 == 0)
        on_the_way.push_back(exposed(seen, camera_from_marker, arm.true_jp(), tick.time_s + latency_s, random));
      ServoInput input;
      input.time_s = tick.time_s;
      input.joints = joints;
      input.desired = desired;
      while (!on_the_way.empty() && on_the_way.front().time_s <= tick.time_s + 1e-9) {
        input.image = on_the_way.front();
        on_the_way.pop_front();
      }
      tick.decision = servo.step(input);
      if (input.image && tick.decision.control.reason == HoldReason::none)
        tips.see(*input.image, *rig.instruments[0].camera_from_rcm);
      if (tick.decision.send) path = servo.path();
      move(arm, path, tick, period_s);
      ticks.push_back(tick);
    }
    return ticks;
  }

 private:
  ImageMeasurement exposed(const FeatureState& seen, const Rigid3& camera_from_marker, const Eigen::Vector4d& q,
                           double stamp_s, Random& random) const {
    const Eigen::Vector4d sigma(4e-4, 0.15, 0.15, 0.15);
    ImageMeasurement image;
    image.found = true;
    image.time_s = stamp_s;
    for (int i = 0; i < 4; ++i) image.features[i] = seen.features[i] + sigma[i] * random.normal();
    // r counts from where the rig has the RCM.
    image.features[1] += (seen.ends_px.head<2>() - rcm_image_px(rig, std::nullopt).value()).norm() - seen.features[1];
    for (int i = 0; i < 4; ++i) image.ends_px[i] = seen.ends_px[i] + 0.15 * random.normal();
    const auto noise = [&](double rms) -> Eigen::Vector3d {
      return rms * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
    };
    image.camera_from_marker = Rigid3{rotation_by(noise(0.5e-3)) * camera_from_marker.rotation,
                                      camera_from_marker.translation + noise(0.02e-3)};
    image.covariance = sigma.cwiseAbs2().asDiagonal();
    image.q = q;
    return image;
  }
  static void move(MujocoArm& arm, const std::optional<JointPath>& path, DynamicTick& tick, double period_s) {
    constexpr int parts = 16;
    for (int i = 1; i <= parts; ++i) {
      if (path) arm.servo_jp(path->at(tick.time_s + period_s * i / parts).position);
      arm.step(period_s / parts);
      tick.fastest = tick.fastest.cwiseMax(arm.true_velocity().cwiseAbs());
    }
  }
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

TEST(DynamicLoop, CrossesFrictionAtReversals) {
  for (const bool sticks : {true, false}) {
    DynamicLoop loop;
    if (!sticks) loop.arm_config.friction.setZero();
    const MujocoArmConfig& config = loop.arm_config;
    std::vector<double> stuck_rad;  // psi's setpoint beyond its joint and lag
    loop.meddle = [&](double, MujocoArm& arm) {
      const double lag_s = config.derivative_gain[3] / config.proportional_gain[3];
      const double ahead_rad = arm.setpoint()[3] - arm.measured_jp()[3];
      stuck_rad.push_back(std::abs(ahead_rad - lag_s * arm.true_velocity()[3]));
    };
    const Eigen::Vector4d rms = rms_from(loop.run(papers, 20), 5);
    EXPECT_NEAR(median(stuck_rad), config.friction[3] / config.proportional_gain[3], 2e-3) << "the test's own power";
    EXPECT_LE(rms[0], 0.3e-3);
    EXPECT_LE(rms[1], 0.15);  // r: without crossing friction 0.50
    EXPECT_LE(rms.tail<2>().maxCoeff(), 0.2);
  }
}

// However long; before it has ever moved, before it has gone both ways, at speed and when it has settled.
TEST(DynamicLoop, IsNotFastWhenABlockedJointIsReleased) {
  for (int joint = 0; joint < 4; ++joint)
    for (const auto& [from_s, for_s] : {std::pair(0.0, 3.0), {0.3, 0.7}, {1.3, 0.2}, {1.3, 3.0}, {4.0, 0.7}}) {
      const Interval wanted{from_s, from_s + for_s};
      SCOPED_TRACE(::testing::Message() << joint << " blocked from " << from_s << " for " << for_s);
      DynamicLoop loop;
      bool blocked = false;
      loop.meddle = [&](double time_s, MujocoArm& arm) {
        if (wanted.contains(time_s) == blocked) return;
        blocked ? arm.release(joint) : arm.block(joint);
        blocked = !blocked;
      };
      const auto ticks = loop.run(papers, wanted.end_s + 4);
      Eigen::Vector4d fastest = Eigen::Vector4d::Zero();
      for (const DynamicTick& tick : ticks) fastest = fastest.cwiseMax(tick.fastest);
      EXPECT_LE(fastest.cwiseQuotient(loop.controller.limits.rate).maxCoeff(), 1.2);
      EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
    }
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
      for (const DynamicTick& tick : ticks) {
        if (tick.time_s < 5) continue;
        EXPECT_NEAR(tick.decision.control.delay_s, delay_s, 0.005) << tick.time_s;
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

// The tip's errors against a circle of 5 mm at 5 mm/s, from its third second on: across the line of sight [m], and in
// the image [px].
struct TipErrors {
  double rms_m = 0, rms_px = 0, worst_m = 0;
};
template <typename Goal>
TipErrors tip_errors(const std::vector<DynamicTick>& ticks, const Camera& camera, const Goal& goal_m) {
  TipErrors errors;
  int count = 0;
  for (const DynamicTick& tick : ticks) {
    if (tick.time_s < 3) continue;
    const Eigen::Vector3d wanted_m = goal_m(tick.time_s), sight = wanted_m.normalized(), off_m = tick.tip_m - wanted_m;
    const double across_m = (off_m - sight * sight.dot(off_m)).norm();
    errors.rms_m += across_m * across_m, ++count;
    errors.rms_px += (camera.ideal_from_point(tick.tip_m) - camera.ideal_from_point(wanted_m)).squaredNorm();
    errors.worst_m = std::max(errors.worst_m, across_m);
  }
  return {std::sqrt(errors.rms_m / count), std::sqrt(errors.rms_px / count), errors.worst_m};
}

// With its tool, and a registration off by 1 mm and 5 mrad.
DynamicLoop loop_of(const Tool& tool, std::uint64_t seed) {
  Random random(seed);
  DynamicLoop loop;
  loop.rig.instruments[0].tool = tool;
  loop.true_rig = misregistered(loop.rig, random);
  return loop;
}

// Where the true scene has the tip at the start, with the wrist as it is.
Eigen::Vector3d first_tip_m(const DynamicLoop& loop) {
  const Instrument& scene = loop.true_rig->instruments[0];
  const Rigid3 camera_from_marker =
      lapservo::camera_from_marker(scene.marker, *scene.camera_from_rcm, JointVector::from_vector(loop.start));
  return camera_from_marker *
         tip_in_marker(*loop.rig.instruments[0].tool, loop.wrist_rad(0)).marker_from_tip.translation;
}

bool never_held(const std::vector<DynamicTick>& ticks, double from_s) {
  return std::none_of(ticks.begin(), ticks.end(), [&](const DynamicTick& t) { return t.time_s > from_s && holds(t); });
}

// 5 mm at 5 mm/s, against friction, backlash and a wrong registration.
TEST(DynamicLoop, TheTipDrawsACircleWhereItWasAskedWhateverTheRegistrationIsOffBy) {
  Tool straight;  // a rod that ends behind the marker
  straight.place.emplace().base_in_marker_m = {0, 0, 0.045};
  for (const std::uint64_t seed : {1, 2}) {
    DynamicLoop loop = loop_of(straight, seed);
    const auto goal_m = [centre_m = first_tip_m(loop)](double time_s) -> Eigen::Vector3d {
      constexpr double radius_m = 5e-3, speed_m_s = 5e-3;
      const double turn_rad = speed_m_s / radius_m * time_s;
      return centre_m + radius_m * Eigen::Vector3d(std::cos(turn_rad) - 1, std::sin(turn_rad), 0);
    };
    const auto ticks = loop.run({0, {}, [&](double time_s) { return TipGoal{goal_m(time_s)}; }}, 16);
    const TipErrors errors = tip_errors(ticks, loop.rig.camera, goal_m);
    EXPECT_TRUE(never_held(ticks, 1)) << seed;
    EXPECT_LE(errors.rms_m, 0.15e-3) << seed;
    EXPECT_LE(errors.rms_px, 0.5) << seed;
  }
}

// By half a radian within two seconds, and back.
TEST(DynamicLoop, TheTipStaysWhereItIsWhileTheWristMoves) {
  for (const std::uint64_t seed : {1, 2}) {
    DynamicLoop loop = loop_of(placed_tool(), seed);
    loop.wrist_rad = [](double time_s) {
      const double there = MinimumJerk::position(std::clamp((time_s - 6) / 2, 0.0, 1.0)),
                   back = MinimumJerk::position(std::clamp((time_s - 9) / 2, 0.0, 1.0));
      return std::vector<double>{0.1 + 0.5 * (there - back), -0.2};
    };
    const Eigen::Vector3d goal_m = first_tip_m(loop) + Eigen::Vector3d(0.003, -0.002, 0.001);
    const auto ticks = loop.run(tip_set_point({goal_m}, "goal"), 12);
    const TipErrors errors = tip_errors(ticks, loop.rig.camera, [&](double) { return goal_m; });
    EXPECT_TRUE(never_held(ticks, 1)) << seed;
    EXPECT_LE(errors.worst_m, 0.3e-3) << seed;
  }
}

}  // namespace lapservo::testing::dynamic_loop_test
