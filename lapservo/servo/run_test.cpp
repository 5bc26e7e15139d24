#include "lapservo/servo/run.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/control/calibration_motion.h"
#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/minimum_jerk.h"
#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/testing/environment.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::run_test {

// The trajectory as the half-size camera sees it.
Trajectory small_trajectory() {
  Sinusoids f = paper_sinusoids();
  f.offset.tail<3>() /= 2, f.amplitude.tail<3>() /= 2;
  return sinusoids(f);
}

struct Case {
  std::uint64_t seed = 1;
  double latency_s = 0.08, duration_s = 8;
  ControlMode mode = ControlMode::fused;
  TrackingThread thread = TrackingThread::callers;
  std::optional<EndoscopeMotion> endoscope{};
  bool operated = true;  ///< then somebody moves the released arm, and says start
  std::optional<Interval> dark{};
  std::optional<double> arm_error_rad{};  ///< of the arm that holds the endoscope: then its pose is known but for this
  std::function<void(SimulatorConfig&)> change{};
};

struct Record {
  ServoInput input;
  ServoDecision decision;
  InstrumentTruth truth;
  Rigid3 camera_from_first_camera{};
  double trajectory_s = 0;
  std::optional<Observation> observation{};
};

struct PastRun {
  std::vector<Record> records;
  Convergence convergence;

  Eigen::Vector4d error(std::size_t i) const {
    return feature_error(records[i].truth.features.value(), records[i].input.desired.features);
  }
  double last_px() const { return error(records.size() - 1).tail<3>().cwiseAbs().maxCoeff(); }
};

// By kinematics of the arm that holds the endoscope, which are off in proportion to the motion.
class EndoscopeOfAnArm : public EndoscopePose {
 public:
  EndoscopeOfAnArm(const EndoscopeMotion& motion, double arm_error_rad) : motion_(motion), off_rad_(arm_error_rad) {}
  std::optional<Rigid3> first_from_camera(double time_s) const override {
    const double passed = std::clamp((time_s - motion_.begin_s) / motion_.duration_s, 0.0, 1.0);
    const double part = motion_.profile == MotionProfile::smooth ? MinimumJerk::position(passed) : passed;
    const Eigen::Vector3d off_rad = part * off_rad_ * Eigen::Vector3d(1, -1, 1).normalized();
    return Rigid3{rotation_by(part * motion_.rotation_rad) * rotation_by(off_rad), part * motion_.translation_m};
  }

 private:
  EndoscopeMotion motion_;
  double off_rad_;
};

RunConfig config_of(const Rig& rig, const Case& c) {
  RunConfig config;
  config.rig = rig;
  if (c.mode == ControlMode::paper) config.controller = paper_controller(config.controller.period_s);
  config.controller.mode = c.mode;
  config.controller.window = image_window(rig.camera, 10), config.tracking_thread = c.thread;
  return config;
}

// The simulated arm, whose operator swings all joints while it is released, until that is enough, and then says start.
class OperatedArm : public Robot {
 public:
  explicit OperatedArm(Simulator& simulator) : simulator_(simulator) {}

  JointState state() override {
    JointState state = simulator_.state();
    state.started = std::exchange(started_, false);
    return state;
  }
  std::vector<JointReading> readings() override { return simulator_.readings(); }
  void send(const JointPath& path) override { simulator_.send(path); }
  bool is_simulated() const override { return true; }

  void operate(const ServoDecision& decision, double time_s) {
    constexpr double rests_s = 1, waits_s = 0.5, period_s = 1.0 / 60;
    if (!decision.release) return hand_.reset();
    if (!hand_) hand_ = Hand{time_s + rests_s, swing_motion(simulator_.measured_jp(), limits_, 1, 8)};
    if (decision.control.reason == HoldReason::endoscope_measured && !hand_->measured_s) hand_->measured_s = time_s;
    started_ = hand_->measured_s && time_s > *hand_->measured_s + waits_s;
    if (hand_->measured_s || time_s < hand_->begin_s) return;
    const double since_s = time_s - hand_->begin_s;
    if (since_s < period_s) path_.reset(time_s, simulator_.measured_jp());
    path_.ramp_to(time_s, (hand_->motion.at(since_s + period_s) - hand_->motion.at(since_s)) / period_s, period_s);
    simulator_.send(path_);
  }

 private:
  struct Hand {
    double begin_s;
    JointMotion motion;
    std::optional<double> measured_s{};
  };
  Simulator& simulator_;
  JointLimits limits_;
  JointPath path_{limits_.acceleration};
  std::optional<Hand> hand_;
  bool started_ = false;
};

class Watcher : public RunObserver {
 public:
  Watcher(const Rig& rig, Simulator& simulator, OperatedArm* operated = nullptr)
      : rig_(rig), simulator_(simulator), operated_(operated) {}

  bool on_tick(const ControlTick& tick) override {
    const double time_s = tick.input.time_s;
    if (operated_) operated_->operate(tick.decision, time_s);
    const Rigid3 camera_from_first_camera = simulator_.camera_from_first_camera();
    const Rigid3 camera_from_rcm = camera_from_first_camera * *rig_.instruments[0].camera_from_rcm;
    done.records.push_back({tick.input, tick.decision,
                            truth_at(feature_model(rig_, camera_from_rcm), simulator_.true_q()),
                            camera_from_first_camera, tick.trajectory_s});
    if (tick.seen) done.records.back().observation = tick.seen->observations[0];
    done.convergence.add(time_s, done.error(done.records.size() - 1));
    return true;
  }

  PastRun done;

 private:
  Rig rig_;
  Simulator& simulator_;
  OperatedArm* operated_;
};

const JointVector start{0.05, 1.57, 0.064, 1.2};

SimulatorConfig without_pictures() {
  SimulatorConfig simulated;
  simulated.endoscope.pictures = false;
  return simulated;
}

PastRun run_case(const Case& c) {
  const Rig rig = testing::small_test_rig();
  RunConfig config = config_of(rig, c);
  const EndoscopeOfAnArm held(c.endoscope.value_or(EndoscopeMotion{}), c.arm_error_rad.value_or(0));
  if (c.arm_error_rad) config.endoscope = &held;
  SimulatorConfig simulated;
  simulated.seed = c.seed, simulated.endoscope.latency_s = c.latency_s;
  if (c.change) c.change(simulated);
  Random random(c.seed);
  const Trajectory trajectory = small_trajectory();
  Simulator simulator(rig, simulated,
                      random_start(trajectory, c.duration_s, feature_model(rig), config.controller,
                                   simulated.arm.joint_offset, random, "trajectory"));
  if (c.dark) simulator.change_light(*c.dark, 0.01F);
  if (c.endoscope) simulator.move_endoscope(*c.endoscope);
  OperatedArm arm(simulator);
  Watcher watcher(rig, simulator, c.operated ? &arm : nullptr);
  run(arm, simulator, simulator, config, trajectory, c.duration_s, watcher);
  return std::move(watcher.done);
}

TEST(Run, FollowsThePapersTrajectoryFromARandomStart) {
  for (const std::uint64_t seed : {1, 2}) {
    SCOPED_TRACE(seed);
    const PastRun done = run_case({.seed = seed});
    ASSERT_TRUE(done.convergence.reached_s());
    EXPECT_LE(*done.convergence.reached_s(), 5);
    Eigen::Vector4d squares = Eigen::Vector4d::Zero(), sum = squares;
    int count = 0;
    for (std::size_t i = 300; i < done.records.size(); ++i, ++count)
      squares += done.error(i).cwiseAbs2(), sum += done.error(i);
    const Eigen::Vector4d rms = (squares / count).cwiseSqrt(), mean = sum / count;
    EXPECT_LE(rms[0], 0.5e-3);
    EXPECT_LE(rms.tail<3>().maxCoeff(), 0.3);
    EXPECT_LE(std::abs(mean[0]), 0.5e-3 / 3);
    EXPECT_LE(mean.tail<3>().cwiseAbs().maxCoeff(), 0.1);
    EXPECT_NEAR(done.records.back().decision.control.delay_s, 0.08, 0.5 / 60);
  }
}

// A wrong rig: reported where r is wrong with it, or nothing is moved. A rotation about the RCM equals an offset of the
// joints.
TEST(Run, IsNotSilentlyWrongWhereTheRigIs) {
  const Rig rig = testing::small_test_rig();
  const auto last_of = [&](const Rig& believed) {
    Simulator simulator(rig, {}, start);
    Watcher watcher(rig, simulator);
    run(simulator, simulator, simulator, config_of(believed, {}), small_trajectory(), 1, watcher);
    return watcher.done.records.back().decision;
  };
  EXPECT_FALSE(last_of(rig).registration_contradicted);
  Rig turned = rig;
  Rigid3& camera_from_rcm = *turned.instruments[0].camera_from_rcm;
  camera_from_rcm.rotation = Eigen::AngleAxisd(0.0873, Eigen::Vector3d::UnitY()) * camera_from_rcm.rotation;
  EXPECT_FALSE(last_of(turned).registration_contradicted);
  for (const Eigen::Vector3d& by : {Eigen::Vector3d(0.01, 0, 0), Eigen::Vector3d(0, -0.01, 0)}) {
    Rig moved = rig;
    moved.instruments[0].camera_from_rcm->translation += by;
    EXPECT_TRUE(last_of(moved).registration_contradicted) << by.transpose();
  }
  for (const double times : {0.9, 1.1}) {
    Rig other_lens = rig;
    other_lens.camera.fx_px *= times, other_lens.camera.fy_px *= times;
    const ServoDecision last = last_of(other_lens);
    EXPECT_TRUE(last.registration_contradicted || last.control.action == ControlAction::hold) << times;
  }
}

constexpr double endoscope_moves_s = 2.5;

// Whether the camera sees the marker and the shaft beside it, whose colour is needed too.
bool shows(const Rig& rig, const Rigid3& camera_from_unrolled) {
  constexpr double beyond_m = 0.012, margin_px = 40;
  for (const double along_m : {-beyond_m, rig.instruments[0].marker.length_m() + beyond_m}) {
    const Eigen::Vector3d point = camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
    if (point.z() <= 0.03 || !rig.camera.contains(rig.camera.raw_from_point(point), margin_px)) return false;
  }
  return true;
}

// As far as the table of what must be shown says, and so that marker and trajectory stay in reach.
EndoscopeMotion random_motion(const Rig& rig, double duration_s, MotionProfile profile, Random& random) {
  constexpr double translation_m = 0.03, rotation_rad = rad_from_deg(20);
  ControllerConfig controller;
  controller.window = image_window(rig.camera, 10);
  const auto q =
      newton_inverse(feature_model(rig), small_trajectory().at(endoscope_moves_s).features, start.vector(), {});
  while (true) {
    const EndoscopeMotion motion{endoscope_moves_s, duration_s, translation_m * testing::random_direction(random),
                                 rotation_rad * testing::random_direction(random), profile};
    const Rigid3 moved =
        Rigid3{rotation_by(motion.rotation_rad), motion.translation_m}.inverse() * *rig.instruments[0].camera_from_rcm;
    if (!shows(rig, moved * rcm_from_unrolled(JointVector::from_vector(q->q)))) continue;
    const std::string refused = testing::input_error(
        [&] { refuse_infeasible(small_trajectory(), 9, feature_model(rig, moved), controller, start, ""); });
    if (refused.empty()) return motion;
  }
}

// No image gave a configuration that is not the instrument's at its exposure.
void expect_right_where_ok(const PastRun& done, double latency_s, double period_s) {
  const Eigen::Array4d right(0.03, 0.03, 0.002, 0.1);
  const auto late = static_cast<std::size_t>(std::lround(latency_s / period_s));
  for (std::size_t i = late; i < done.records.size(); ++i) {
    const auto& seen = done.records[i].observation;
    if (!seen || seen->status != Status::ok || !seen->rcm) continue;
    Eigen::Vector4d off = seen->rcm->q.vector() - done.records[i - late].truth.q;
    off[3] = wrap_pi(off[3]);
    EXPECT_TRUE((off.array().abs() < right).all()) << done.records[i].input.time_s << " s: " << off.transpose();
  }
}

std::vector<Blotch> blood() {
  return {{0.5, 0.012, 0.002}, {2.5, 0.02, 0.0015}, {4.5, 0.03, 0.002}, {5.5, 0.008, 0.0015}};
}

// Images with motion in them, blurred, veiled and stained, and dark for a while.
TEST(Run, IsNeverWrongByPicturesThatAreHardToRead) {
  Case c;
  c.duration_s = 5, c.dark = Interval{2, 2.6};
  c.change = [](SimulatorConfig& config) {
    config.endoscope.exposure_s = 0.015, config.render.smoke = 0.35F, config.blotches = blood();
  };
  const ControllerConfig controller = config_of(testing::small_test_rig(), c).controller;
  const PastRun done = run_case(c);
  for (const Record& record : done.records) {
    EXPECT_EQ(record.decision.registration, 0);
    const double time_s = record.input.time_s;
    if (time_s < c.dark->begin_s + 0.1 + 2 * controller.period_s || time_s > c.dark->end_s + 0.07) continue;
    EXPECT_EQ(record.decision.control.action, ControlAction::hold) << time_s;
  }
  expect_right_where_ok(done, c.latency_s, controller.period_s);
  EXPECT_EQ(done.records.back().decision.control.action, ControlAction::track);
  EXPECT_LT(done.last_px(), 1);
}

std::vector<LoggedTick> logged(const PastRun& done) {
  const testing::TemporaryFolder folder;
  ServoLog log(folder / "log.csv");
  for (const Record& record : done.records) log.add(record.input, record.decision, record.truth);
  log.commit();
  return read_servo_log(folder / "log.csv");
}

// From the moment on in which the loop released the arm nothing was sent, nor was another registration gone by, until
// the operator said start.
void expect_nothing_until_start(const PastRun& done) {
  bool released = false;
  int registration = 0;
  for (const auto& [input, decision, truth, camera, since_s, seen] : done.records) {
    if (input.joints.started && released) released = false, ++registration;
    if (decision.release && !released) released = true, ++registration;
    EXPECT_EQ(decision.release, released) << input.time_s;
    EXPECT_EQ(decision.registration, registration) << input.time_s;
    EXPECT_FALSE(released && decision.send) << input.time_s;
  }
}

// Right: the task within 5 mrad and a pixel.
void expect_measured_anew(const Rig& rig, const Case& c) {
  const Eigen::Array4d right(5e-3, 1, 1, 1);
  const PastRun done = run_case(c);
  const ControllerConfig controller = config_of(rig, c).controller;
  std::optional<double> held_s, started_s;
  double wrong_s = 0;
  for (std::size_t k = 0; k < done.records.size(); ++k) {
    const ServoDecision& decision = done.records[k].decision;
    const double since_s = done.records[k].input.time_s - endoscope_moves_s;
    if (since_s < 0) continue;
    if (!held_s && decision.control.action == ControlAction::hold) held_s = since_s;
    if (!started_s && decision.registration == 2) started_s = since_s;
    if (!(done.error(k).array().abs() < right).all()) wrong_s = since_s;
  }
  ASSERT_TRUE(held_s && started_s);
  const auto difference = replay(logged(done), rig, controller);
  EXPECT_FALSE(difference) << difference->tick << " " << difference->column;
  expect_nothing_until_start(done);
  // By the first image that shows it, 83 or 100 ms; by the second one where builds' last bits differ.
  EXPECT_LE(*held_s, c.endoscope->duration_s > 0 ? 0.12 : 0.1);
  EXPECT_LE(wrong_s, c.duration_s - endoscope_moves_s - 0.3);
  if (c.endoscope->duration_s == 0) expect_right_where_ok(done, c.latency_s, controller.period_s);
}

// Held at once, measured anew by the operator's motion, and on again after start. At once and slowly, so that what is
// seen meanwhile belongs to neither place.
TEST(Run, GoesOnAfterStartWhereTheEndoscopeMoved) {
  const Rig rig = testing::small_test_rig();
  Random random(1);
  for (const double duration_s : {0.0, 0.6}) {
    SCOPED_TRACE(duration_s);
    expect_measured_anew(rig,
                         {.duration_s = 14, .endoscope = random_motion(rig, duration_s, MotionProfile::even, random)});
  }
}

// How far the marker lies, in the camera's frame, from where it would if the endoscope had not moved.
double beside_m(const Rig& rig, const InstrumentTruth& truth, const Rigid3& camera_from_first_camera) {
  const Rigid3& first_camera_from_rcm = *rig.instruments[0].camera_from_rcm;
  const JointVector q = JointVector::from_vector(truth.q);
  const Eigen::Vector3d first = (first_camera_from_rcm * rcm_from_unrolled(q)).translation;
  return (camera_from_first_camera * first - first).norm();
}

// Times of holds since the endoscope began to move, and since that is plain: the marker lies 0.5 mm beside.
struct HeldAfter {
  int runs = 0, in_time = 0;
  double held_s = 0, plain_s = 0, latest_plain_s = -1;

  void add(const Rig& rig, const Case& c) {
    constexpr double in_time_s = 0.1;
    const PastRun done = run_case(c);
    const ControllerConfig controller = config_of(rig, c).controller;
    std::optional<double> plain, held;
    for (const Record& record : done.records) {
      const double since_s = record.input.time_s - endoscope_moves_s;
      const bool shown = since_s > c.latency_s - 0.01;
      if (since_s > -1 && !shown) {
        EXPECT_NE(record.decision.control.reason, HoldReason::endoscope_moved) << since_s;
      }
      if (since_s < 0) continue;
      if (!plain && beside_m(rig, record.truth, record.camera_from_first_camera) > 5e-4) plain = since_s;
      if (!held && shown && record.decision.control.action == ControlAction::hold) held = since_s;
    }
    ASSERT_TRUE(plain && held);
    ++runs, held_s += *held, plain_s += *held - *plain;
    latest_plain_s = std::max(latest_plain_s, *held - *plain);
    in_time += *held - *plain <= in_time_s + controller.period_s;
  }
};

int endoscopes() {
  return testing::from_environment("LAPSERVO_ENDOSCOPES", 1);
}
std::uint64_t endoscope_seed() {
  return static_cast<std::uint64_t>(testing::from_environment("LAPSERVO_ENDOSCOPE_SEED", 1));
}
std::uint64_t endoscope_run_seed(int i) {
  return 100 * endoscope_seed() + static_cast<std::uint64_t>(i);
}

// An even motion is plain at once; from rest to rest it shows little at first and gains speed from image to image.
// LAPSERVO_ENDOSCOPES=10 LAPSERVO_ENDOSCOPE_SEED=2: ten of each, and others.
TEST(Run, HoldsAnEndoscopeThatMovesWhenThatIsPlain) {
  const Rig rig = testing::small_test_rig();
  Random random(endoscope_seed());
  for (const auto profile : {MotionProfile::even, MotionProfile::smooth})
    for (const double duration_s : {0.0, 0.6, 1.0, 2.0, 4.0}) {
      if (profile == MotionProfile::smooth && duration_s == 0) continue;
      const char* name = profile == MotionProfile::smooth ? "smooth" : "even";
      SCOPED_TRACE(::testing::Message() << name << " " << duration_s);
      HeldAfter after;
      for (int i = 0; i < endoscopes(); ++i)
        after.add(rig, {.seed = endoscope_run_seed(i),
                        .duration_s = endoscope_moves_s + duration_s / 2 + 0.5,
                        .endoscope = random_motion(rig, duration_s, profile, random)});
      std::printf(
          "%s %.1f s: held %.3f s after the beginning, %+.3f (latest %+.3f) after it is plain, in time %d of %d\n",
          name, duration_s, after.held_s / after.runs, after.plain_s / after.runs, after.latest_plain_s, after.in_time,
          after.runs);
      EXPECT_LE(after.plain_s / after.runs, duration_s > 1 ? 0.6 : 0.1 + 1.0 / 60);
    }
}

// Turned by 0.2 rad and moved by 20 mm in 4 s, where an arm that follows stays within its limits and its marker in the
// image: as far from the RCM's image as before, which moves.
EndoscopeMotion reachable_motion(const Rig& rig, const ControllerConfig& config, MotionProfile profile, double begin_s,
                                 Random& random) {
  constexpr double step_s = 0.05;
  const Eigen::Vector4d margin(0.1, 0.1, 0.005, 0.2);
  const auto is_followed = [&](const EndoscopeMotion& motion) {
    const EndoscopeOfAnArm held(motion, 0);
    Eigen::Vector4d q = start.vector();
    for (double time_s = 0; time_s < begin_s + 8; time_s += step_s) {
      const Rigid3 camera_from_rcm = held.first_from_camera(time_s)->inverse() * *rig.instruments[0].camera_from_rcm;
      const auto found =
          newton_inverse(feature_model(rig, camera_from_rcm), small_trajectory().at(time_s).features, q, {});
      if (!found || !found->converged) return false;
      const Eigen::Array4d rate = (found->q - q).cwiseAbs() / step_s;
      q = found->q;
      if ((q.array() < (config.limits.lower + margin).array()).any() ||
          (q.array() > (config.limits.upper - margin).array()).any() ||
          (time_s > 0 && (rate > 0.8 * config.limits.rate.array()).any()) ||
          !shows(rig, camera_from_rcm * rcm_from_unrolled(JointVector::from_vector(q))))
        return false;
    }
    return true;
  };
  while (true) {
    const EndoscopeMotion motion{begin_s, 4, 0.02 * testing::random_direction(random),
                                 0.2 * testing::random_direction(random), profile};
    if (is_followed(motion)) return motion;
  }
}

// Features in the true image: within 3 px while it moves, within 0.2 px when it rests again. r, the distance from the
// RCM's image, is off by as much as that image is: 1 mrad of the arm that holds the endoscope is 0.6 px here, and up to
// twice as much by its way.
TEST(Run, TracksOnWhileAnArmMovesTheEndoscope) {
  const Rig rig = testing::small_test_rig();
  const ControllerConfig controller = config_of(rig, {}).controller;
  Random random(endoscope_seed());
  constexpr double begin_s = 5;
  for (const double arm_error_rad : {0.0, 1e-3})
    for (const auto profile : {MotionProfile::even, MotionProfile::smooth})
      for (int i = 0; i < endoscopes(); ++i) {
        const std::uint64_t seed = endoscope_run_seed(i);
        const PastRun done = run_case({.seed = seed,
                                       .duration_s = begin_s + 8,
                                       .endoscope = reachable_motion(rig, controller, profile, begin_s, random),
                                       .operated = false,
                                       .arm_error_rad = arm_error_rad});
        Eigen::Vector4d meanwhile = Eigen::Vector4d::Zero(), after = meanwhile;
        int held = 0;
        for (const Record& record : done.records) {
          const double time_s = record.input.time_s;
          if (time_s < begin_s) continue;
          held += record.decision.control.action != ControlAction::track;
          Eigen::Vector4d& most = time_s < begin_s + 4 ? meanwhile : after;
          if (time_s < begin_s + 4 || time_s > begin_s + 5)
            most = most.cwiseMax(
                feature_error(record.truth.features.value(), small_trajectory().at(record.trajectory_s).features)
                    .cwiseAbs());
        }
        const char* name = profile == MotionProfile::even ? "even" : "smooth";
        std::printf(
            "%s, arm off by %.0f mrad, seed %d: s %.2f mrad, r %.2f, l %.2f, d %.2f px meanwhile; s %.2f mrad, r "
            "%.2f, l %.2f, d %.2f px after; %d ticks held\n",
            name, 1e3 * arm_error_rad, static_cast<int>(seed), 1e3 * meanwhile[0], meanwhile[1], meanwhile[2],
            meanwhile[3], 1e3 * after[0], after[1], after[2], after[3], held);
        EXPECT_EQ(held, 0);
        EXPECT_LE(meanwhile.tail<3>().maxCoeff(), 3);
        EXPECT_LE(after[0], 0.5e-3);
        EXPECT_LE(after.tail<2>().maxCoeff(), 0.2);
        EXPECT_LE(after[1], arm_error_rad > 0 ? 1.5 : 0.3);
      }
}

// An arm that reports another motion than the images show.
TEST(Run, HoldsWhereImagesContradictTheArmThatHoldsTheEndoscope) {
  Random random(1);
  const Rig rig = testing::small_test_rig();
  const EndoscopeMotion motion = reachable_motion(rig, config_of(rig, {}).controller, MotionProfile::even, 3, random);
  const PastRun done = run_case({.duration_s = 6, .endoscope = motion, .operated = false, .arm_error_rad = 0.2});
  const ServoDecision& last = done.records.back().decision;
  EXPECT_EQ(last.control.reason, HoldReason::endoscope_moved);
  EXPECT_FALSE(last.remedy.empty());
}

// Late and lost images, play, registrations that are 5 and 10 mm off, blur, smoke, blood: nothing moved.
std::vector<std::pair<const char*, std::function<void(SimulatorConfig&)>>> resting() {
  using Config = SimulatorConfig;
  const auto rcm_off = [](const Eigen::Vector3d& by_m) { return [=](Config& c) { c.arm.rcm_offset_m = by_m; }; };
  return {{"as it is", [](Config&) {}},
          {"jitter 8 ms", [](Config& c) { c.endoscope.jitter_s = 0.008; }},
          {"a tenth lost", [](Config& c) { c.endoscope.dropped_fraction = 0.1; }},
          {"play",
           [](Config& c) {
             c.arm.backlash = {1e-3, 1e-3, 8e-4, 0.03};
           }},
          {"RCM 5 mm off", rcm_off({0.003, -0.003, 0.003})},
          {"RCM 10 mm off", rcm_off({-0.006, 0.006, 0.006})},
          {"exposure 15 ms", [](Config& c) { c.endoscope.exposure_s = 0.015; }},
          {"smoke", [](Config& c) { c.render.smoke = 0.35F; }},
          {"blood", [](Config& c) { c.blotches = blood(); }},
          {"latency 0.2 s", [](Config& c) { c.endoscope.latency_s = 0.2; }}};
}

TEST(Run, DoesNotHoldAnEndoscopeThatRests) {
  int ticks = 0, held = 0;
  for (const auto& [name, change] : resting()) {
    int held_here = 0;
    for (int i = 0; i < endoscopes(); ++i) {
      const PastRun done = run_case({.seed = endoscope_run_seed(i), .duration_s = 5, .change = change});
      for (const Record& record : done.records)
        ++ticks, held_here += record.decision.control.reason == HoldReason::endoscope_moved;
    }
    if (held_here > 0) std::printf("%s: held in %d ticks\n", name, held_here);
    held += held_here;
  }
  std::printf("held in %d of %d ticks\n", held, ticks);
  EXPECT_LE(held, 0.005 * ticks);
}

// Four places of the tip, 50 mm or more from the one before. From the first tick on the wanted one changes every 3 s.
class FarTips : public Watcher {
 public:
  FarTips(const Rig& truth, const Rig& rig, Simulator& simulator, Random& random) : Watcher(truth, simulator) {
    const Instrument& instrument = rig.instruments[0];
    while (tips_m_.size() < 4) {
      const JointVector q{start.theta_rad + random.uniform(-0.7, 0.7), start.phi_rad + random.uniform(-0.7, 0.7),
                          random.uniform(0.04, 0.12), start.psi_rad};
      if (!shows(rig, *instrument.camera_from_rcm * rcm_from_unrolled(q))) continue;
      const Eigen::Vector3d tip_m = camera_from_marker(instrument.marker, *instrument.camera_from_rcm, q) *
                                    instrument.tool->place->base_in_marker_m;
      if (tips_m_.empty() || (tip_m - tips_m_.back()).norm() > 0.05) tips_m_.push_back(tip_m);
    }
  }

  bool on_tick(const ControlTick& tick) override {
    wanted_ = static_cast<std::size_t>(std::min(tick.input.time_s / 3, 3.0));
    return Watcher::on_tick(tick);
  }
  Trajectory goals() const {
    return {0, {}, [this](double) { return TipGoal{tips_m_[wanted_]}; }};
  }

 private:
  std::vector<Eigen::Vector3d> tips_m_;
  std::size_t wanted_ = 0;
};

// A registration that is off by LAPSERVO_OFF_MM (3) and 5 mrad a mm, and has no standard deviations, misfits by more
// and less where a straight tool goes far: nothing moved.
TEST(Run, DoesNotHoldAnEndoscopeThatRestsWhereTheTipGoesFar) {
  const double off_mm = testing::from_environment("LAPSERVO_OFF_MM", 3);
  int held = 0, released = 0;
  for (int i = 0; i < endoscopes(); ++i) {
    Random random(endoscope_run_seed(i));
    Rig truth = testing::small_test_rig();
    truth.instruments[0].tool.emplace().place.emplace().base_in_marker_m = {0, 0, 0.045};
    const Rig rig = testing::misregistered(truth, random, off_mm);
    SimulatorConfig simulated;
    simulated.seed = endoscope_run_seed(i), simulated.endoscope.latency_s = 0.08;
    Simulator simulator(truth, simulated, start);
    FarTips watcher(truth, rig, simulator, random);
    run(simulator, simulator, simulator, config_of(rig, {}), watcher.goals(), 12, watcher);
    for (const Record& record : watcher.done.records)
      held += record.decision.control.reason == HoldReason::endoscope_moved;
    released += watcher.done.records.back().decision.release;
  }
  std::printf("held in %d ticks of %d runs, released in %d\n", held, endoscopes(), released);
  EXPECT_EQ(released, 0);
  EXPECT_LE(held, endoscopes());
}

// The same seed gives the same run, and the log is enough to decide everything again.
TEST(Run, RepeatsAndReplaysBitForBit) {
  const Case c{.seed = 4, .duration_s = 2};
  Case by_paper = c, of_moving_endoscope = c;
  by_paper.mode = ControlMode::paper;
  of_moving_endoscope.endoscope = {0.3, 1, {0.005, -0.005, 0}, {0, 0.05, 0.05}, MotionProfile::smooth};
  of_moving_endoscope.arm_error_rad = 0;
  for (const Case& one : {c, by_paper, of_moving_endoscope}) {
    const PastRun first = run_case(one), second = run_case(one);
    ASSERT_EQ(first.records.size(), second.records.size());
    for (std::size_t i = 0; i < first.records.size(); ++i)
      ASSERT_EQ(decision_fields(first.records[i].decision), decision_fields(second.records[i].decision)) << i;
    RunConfig config = config_of(testing::small_test_rig(), one);
    const EndoscopeOfAnArm held({}, 0);
    if (one.endoscope) config.endoscope = &held;
    auto ticks = logged(first);
    EXPECT_FALSE(replay(ticks, config.rig, controller_of(config)));
    ticks[70].input.desired.features[1] += 1e-9;
    EXPECT_TRUE(replay(ticks, config.rig, controller_of(config)));
  }
}

// Vision that is at its first image until the last tick, of which it is the observer.
struct EndlessVision : ImageStream, RunObserver {
  static constexpr int ticks = 60;
  std::optional<StampedImage> newest() override {
    begun = true;
    if (!testing::wait_for([this] { return ended.load(); })) gave_up = true;
    return std::nullopt;
  }
  bool on_tick(const ControlTick& tick) override {
    EXPECT_TRUE(testing::wait_for([this] { return begun.load(); }));
    sent += tick.decision.send;
    ended = ++done >= ticks;
    return true;
  }
  std::atomic<bool> begun = false, ended = false, gave_up = false;
  int done = 0, sent = 0;
};

TEST(Run, SetPointsDoNotWaitForVisionInItsOwnThread) {
  const Rig rig = testing::small_test_rig();
  Simulator simulator(rig, without_pictures(), start);
  EndlessVision vision;
  run(simulator, vision, simulator, config_of(rig, {.thread = TrackingThread::own}), small_trajectory(), 1, vision);
  EXPECT_FALSE(vision.gave_up);
  EXPECT_EQ(vision.done, EndlessVision::ticks);
  EXPECT_EQ(vision.sent, EndlessVision::ticks);
}

// A camera whose third image is of another size.
class WrongThirdImage : public ImageStream {
 public:
  explicit WrongThirdImage(const Rig& rig) : right_(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar()) {}
  std::optional<StampedImage> newest() override {
    return StampedImage{0, ++images_ < 3 ? right_ : right_(cv::Rect(0, 0, 20, 10))};
  }

 private:
  cv::Mat right_;
  int images_ = 0;
};

TEST(Run, WhatVisionThrowsInItsOwnThreadEndsTheRunAndReleasesTheArm) {
  class Driven : public OperatedArm {
   public:
    using OperatedArm::OperatedArm;
    void release() override { released = true; }
    bool released = false;
  };
  class Whoever : public RunObserver {
    bool on_tick(const ControlTick&) override { return true; }
  } nobody;
  constexpr double hangs_s = 60;
  const Rig rig = testing::small_test_rig();
  Simulator simulator(rig, without_pictures(), start);
  Driven arm(simulator);
  SteadyClock clock;
  WrongThirdImage camera(rig);
  const RunConfig config = config_of(rig, {.thread = TrackingThread::own});
  const std::string said =
      testing::input_error([&] { run(arm, camera, clock, config, small_trajectory(), hangs_s, nobody); });
  EXPECT_EQ(said, "image: size: is 20x10, expected 640x360 as in the rig");
  EXPECT_TRUE(arm.released);
}

TEST(Run, TheTrajectoryStandsWhileTheArmIsHeld) {
  struct Person : RunObserver {
    bool on_tick(const ControlTick& tick) override {
      if (ticks == 20) arm.stop(Commander::page);
      if (ticks == 5 || ticks == 40) arm.start(Commander::page, tick.input.time_s);
      moved += ticks++ > 0 && arm.armed() && !loop_held;
      loop_held = tick.decision.control.action == ControlAction::hold;
      EXPECT_NEAR(tick.trajectory_s, moved / 60.0, 1e-9);
      const Eigen::Vector4d then = small_trajectory().at(moved / 60.0).features;
      EXPECT_LT((tick.input.desired.features - then).norm(), 1e-6) << ticks;
      return true;
    }
    Supervisor& arm;
    int ticks = 0, moved = 0;
    bool loop_held = false;
    explicit Person(Supervisor& of) : arm(of) {}
  };
  const Rig rig = testing::small_test_rig();
  Simulator simulator(rig, {}, start);
  Supervisor arm(simulator, simulator);
  arm.stop(Commander::page);
  Person person(arm);
  run(arm, simulator, simulator, config_of(rig, {}), small_trajectory(), 1, person);
  EXPECT_EQ(person.ticks, 60);
  EXPECT_GT(person.moved, 10);
  EXPECT_LT(person.moved, 40);
}

TEST(Run, NeedsTheLimitsOfAnArmThatIsNotSimulated) {
  class Real : public OperatedArm {
   public:
    using OperatedArm::OperatedArm;
    bool is_simulated() const override { return false; }
  };
  const Rig rig = testing::small_test_rig();
  Simulator simulator(rig, {}, start);
  Real arm(simulator);
  Watcher watcher(rig, simulator);
  RunConfig config = config_of(rig, {});
  const auto complaint = [&] {
    return testing::input_error([&] { run(arm, simulator, simulator, config, small_trajectory(), 0.1, watcher); });
  };
  EXPECT_EQ(complaint(), "RunConfig: arm_limits: is missing, expected the limits of the arm's joints");
  config.arm_limits.emplace();
  EXPECT_EQ(complaint(), "");
}

// Held, and the operator swings the joints of the released arm. Signs and offsets: Disagreement.
TEST(Run, NamesWhatOfTheRigWasWrongFromTheStart) {
  const Rig rig = testing::small_test_rig();
  RunConfig config = config_of(rig, {});
  Rigid3& believed = *config.rig.instruments[0].camera_from_rcm;
  believed.rotation = rotation_by({0.3, 0.4, -0.3}) * believed.rotation;
  Simulator simulator(rig, {}, start);
  OperatedArm arm(simulator);
  Watcher watcher(rig, simulator, &arm);
  run(arm, simulator, simulator, config, small_trajectory(), 6, watcher);
  std::string named;
  for (const Record& record : watcher.done.records) {
    const ServoDecision& decision = record.decision;
    EXPECT_NE(decision.control.reason, HoldReason::endoscope_measured) << record.input.time_s;
    EXPECT_FALSE(decision.send && decision.control.reason == HoldReason::wrong_rig) << record.input.time_s;
    if (!decision.remedy.empty()) named = decision.remedy;
  }
  EXPECT_EQ(named, "camera_from_rcm is wrong, or the camera shows another arm: run lapservo calibrate registration");
}

// Its joints carry the times of another clock, and it may be on its way at first, from where no goal can be reached.
class AheadArm : public OperatedArm {
 public:
  AheadArm(Simulator& simulator, double ahead_s, double homing_s)
      : OperatedArm(simulator), ahead_s_(ahead_s), homing_s_(homing_s) {}
  JointState state() override {
    JointState state = OperatedArm::state();
    if (state.time_s < homing_s_) {
      state.q = {0, pi / 2, -0.0156, 0}, state.blocked = Blocked::busy;
    } else {
      state.started = std::exchange(homing_s_, 0) > 0;
    }
    state.time_s += ahead_s_;
    return state;
  }

 private:
  double ahead_s_, homing_s_;
};

// The room with another clock for images, or a loop's clock that is out of order.
class OtherClock : public ImageStream, public Clock {
 public:
  OtherClock(Simulator& simulator, double ahead_s, bool in_order)
      : simulator_(simulator), ahead_s_(ahead_s), in_order_(in_order) {}
  std::optional<StampedImage> newest() override {
    auto image = simulator_.newest();
    if (image) image->time_s += ahead_s_;
    return image;
  }
  double now_s() const override { return in_order_ ? simulator_.now_s() : NAN; }
  void sleep_until(double time_s) override { simulator_.sleep_until(time_s); }

 private:
  Simulator& simulator_;
  double ahead_s_;
  bool in_order_;
};

struct Refused {
  Trajectory trajectory = small_trajectory();
  ControlMode mode = ControlMode::fused;
  bool registered = true;
  double duration_s = 1;
  double joints_ahead_s = 0, images_ahead_s = 0;
  double homing_s = 0;
  bool clock_in_order = true, held_by_page = false;
};

// The refusal of a run, in which nothing moved.
std::string refusal_of(const Refused& refused) {
  Rig rig = testing::small_test_rig();
  rig.instruments[0].tool.emplace().place.emplace().base_in_marker_m = {0, 0, 0.045};
  RunConfig config = config_of(rig, {.mode = refused.mode});
  config.rcm_px = rcm_image_px(rig, {});
  config.trajectory_name = "fast.csv";
  if (!refused.registered) config.rig.instruments[0].camera_from_rcm.reset();
  Simulator simulator(rig, {}, start);
  const Eigen::Vector4d before = simulator.measured_jp();
  AheadArm arm(simulator, refused.joints_ahead_s, refused.homing_s);
  OtherClock others(simulator, refused.images_ahead_s, refused.clock_in_order);
  Watcher watcher(rig, simulator);
  Supervisor supervisor(arm, others);
  if (refused.held_by_page) supervisor.stop(Commander::page);
  const std::string said = testing::input_error(
      [&] { run(supervisor, others, others, config, refused.trajectory, refused.duration_s, watcher); });
  EXPECT_TRUE(said.empty() || simulator.measured_jp() == before) << said;
  EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  return said;
}

TEST(Run, RefusesWhatCanNotBeFollowed) {
  EXPECT_EQ(refusal_of({}), "");
  // At once, and where the arm has been homed to.
  for (const double homing_s : {0.0, 0.3}) {
    EXPECT_EQ(refusal_of({.trajectory = set_point({0.9, 397, 182, 106}), .homing_s = homing_s}), "");
    EXPECT_NE(refusal_of({.trajectory = set_point({3, 1e4, 1e4, 5e3}), .homing_s = homing_s}), "");
  }
  EXPECT_EQ(refusal_of({.trajectory = set_point({0.9, 397, 182, 106}), .homing_s = 0.3, .held_by_page = true}), "");
}

TEST(Run, RefusesFeaturesThatNoImageShowsInEveryMode) {
  const std::string complaint = "fast.csv: can't be followed at 0.00 s: no image shows these features";
  for (Refused refused : {Refused{}, Refused{.mode = ControlMode::paper}, Refused{.mode = ControlMode::uncalibrated},
                          Refused{.mode = ControlMode::uncalibrated, .registered = false}})
    for (const Eigen::Vector4d& f : {Eigen::Vector4d(0, 0, 0, 0), Eigen::Vector4d(0.9, 400, 180, 180),
                                     Eigen::Vector4d(0.9, NAN, 180, 100), Eigen::Vector4d(0.9, -1, 180, 100)}) {
      refused.trajectory = {0, [f](double) { return DesiredFeatures{f}; }};
      EXPECT_EQ(refusal_of(refused), complaint) << to_string(refused.mode) << refused.registered << f.transpose();
    }
}

TEST(Run, RefusesOtherClocksThanTheLoops) {
  EXPECT_EQ(refusal_of({.joints_ahead_s = 1e9}),
            "JointState: time_s: is 1000000000.000, expected a time of the loop's clock, which is at 0.000");
  EXPECT_EQ(refusal_of({.images_ahead_s = 1e9}).find("ImageStream: time_s: is 1000000000.0"), 0U);
  EXPECT_EQ(refusal_of({.clock_in_order = false}), "Clock: now_s: is nan, expected a finite time");
  EXPECT_EQ(refusal_of({.duration_s = NAN}), "run: duration_s: is nan, expected 0 or more");
}

}  // namespace lapservo::internal::run_test
