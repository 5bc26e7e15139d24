#include "lapservo/control/visual_controller.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/control/test_simulator.h"
#include "lapservo/core/error.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal::visual_controller_test {

using namespace testing;

const Eigen::Vector4d close_enough{0.005, 1, 1, 1};

/// Kinematic offsets of 2 degrees and 3 mm, a lagging arm.
Flaws usual_flaws(const Eigen::Vector4d& backlash = Eigen::Vector4d::Zero()) {
  Flaws flaws;
  flaws.offset = {0.035, -0.035, 0.003, 0.035}, flaws.lag_s = 0.02, flaws.backlash = backlash;
  return flaws;
}

using Moments = std::vector<Moment>;

/// When the features came close for good.
double settled_s(const Moments& moments) {
  double last_s = 0;
  for (const Moment& m : moments)
    if ((m.error.cwiseAbs() - close_enough).maxCoeff() > 0) last_s = m.time_s;
  return last_s;
}

/// The errors from then on.
Eigen::Vector4d rms_after(const Moments& moments, double time_s) {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  int samples = 0;
  for (const Moment& m : moments)
    if (m.time_s >= time_s) sum += m.error.cwiseAbs2(), ++samples;
  return (sum / samples).cwiseSqrt();
}

void expect_limits_kept(const Moments& moments, const JointLimits& limits, double period_s) {
  MotionState before{moments.front().step.setpoint.position, Eigen::Vector4d::Zero()};
  for (const Moment& m : moments) {
    const MotionState& now = m.step.setpoint;
    ASSERT_TRUE(now.position.allFinite() && now.velocity.allFinite()) << m.time_s;
    ASSERT_LE((now.position - limits.upper).maxCoeff(), 1e-9) << m.time_s;
    ASSERT_LE((limits.lower - now.position).maxCoeff(), 1e-9) << m.time_s;
    ASSERT_LE((now.velocity.cwiseAbs() - limits.rate).maxCoeff(), 1e-9) << m.time_s;
    const Eigen::Vector4d change = (now.velocity - before.velocity).cwiseAbs();
    ASSERT_LE((change - limits.acceleration * period_s).maxCoeff(), 1e-9) << m.time_s;
    before = now;
  }
}

void expect_in_image(const Moments& moments) {
  for (const Moment& m : moments) {
    const Eigen::Vector4d& e = m.truth.ends_px;
    ASSERT_GE(e.minCoeff(), 0) << m.time_s;
    ASSERT_LE(std::max(e[0], e[2]), 1279) << m.time_s;
    ASSERT_LE(std::max(e[1], e[3]), 719) << m.time_s;
  }
}

/// No limit is ever crossed.
Moments run_anywhere(const ControllerConfig& config, const FeatureModel& model, const Flaws& flaws,
                     const Trajectory& trajectory, double duration_s, std::uint64_t seed) {
  Random random(seed);
  const TestRig rig;
  VisualController controller(config, model);
  TestSimulator simulator(rig, flaws, testing::random_start(rig, config, flaws, random), seed);
  const Moments done = simulator.run(controller, trajectory, duration_s);
  expect_limits_kept(done, config.limits, config.period_s + flaws.jitter_s);
  return done;
}

/// Nor does the marker leave the image.
Moments run(const ControllerConfig& config, const FeatureModel& model, const Flaws& flaws, const Trajectory& trajectory,
            double duration_s, std::uint64_t seed) {
  const Moments done = run_anywhere(config, model, flaws, trajectory, duration_s, seed);
  expect_in_image(done);
  return done;
}

/// The usual controller, which knows the rig.
Moments run(const Flaws& flaws, const Trajectory& trajectory, double duration_s, std::uint64_t seed) {
  return run(testing::test_config(flaws), testing::model_of({}), flaws, trajectory, duration_s, seed);
}

/// Decay of a feature's error per second: the slope of its logarithm, from the last limited motion until it is below
/// `least`. nullopt when it does not halve in between.
std::optional<double> decay_per_s(const Moments& moments, int feature, double least) {
  std::size_t from = 0;
  for (std::size_t k = 0; k < moments.size(); ++k) {
    if (moments[k].step.limited || moments[k].time_s < 0.1) from = k + 1;
  }
  double n = 0, t = 0, y = 0, tt = 0, ty = 0;
  const auto error = [&](std::size_t k) { return std::abs(moments[k].error[feature]); };
  std::size_t k = from;
  for (; k < moments.size() && error(k) > least; ++k) {
    const double time_s = moments[k].time_s, value = std::log(error(k));
    n += 1, t += time_s, y += value, tt += time_s * time_s, ty += time_s * value;
  }
  if (k < from + 10 || error(from) < 2 * error(k - 1)) return std::nullopt;
  return -(n * ty - t * y) / (n * tt - t * t);
}

/// Eq. (22): with the true model and no latency every feature's error decays with its own K, at a setpoint and along
/// the trajectory. The errors are measured while they are large beside the remainder of the feed-forward of a period
/// ago.
TEST(PaperLaw, EachFeaturesErrorDecaysWithItsOwnK) {
  Flaws flaws;
  flaws.latency_s = 0, flaws.noise.setZero();
  ControllerConfig config = paper_controller(1.0 / 60);
  config.window = testing::test_config(flaws).window, config.observer.delay_s = 0;
  EXPECT_EQ(config.gains.per_s, paper_gains(1.0 / 60).per_s);
  const Eigen::Vector4d least(0.01, 15, 8, 12);
  for (const auto& trajectory : {set_point(paper_sinusoids().offset), sinusoids(paper_sinusoids())}) {
    Eigen::Vector4i measured = Eigen::Vector4i::Zero();
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE(seed);
      const auto done = run(config, testing::model_of({}), flaws, trajectory, 30, seed);
      for (int i = 0; i < 4; ++i) {
        const auto decay = decay_per_s(done, i, least[i]);
        if (!decay) continue;
        ++measured[i];
        EXPECT_NEAR(*decay, config.gains.per_s[i], 0.05 * config.gains.per_s[i]) << "feature " << i;
      }
    }
    EXPECT_GE(measured.minCoeff(), 5) << measured.transpose();
  }
}

TEST(VisualController, IsStableAtAnyLatencyKnownOrEstimated) {
  Eigen::Vector4d rms_at_zero = Eigen::Vector4d::Zero();
  for (const bool known : {true, false}) {
    for (const double latency_s : {0.0, 0.05, 0.1, 0.15, 0.2, 0.25}) {
      SCOPED_TRACE(std::string(known ? "known " : "estimated ") + std::to_string(latency_s));
      Flaws flaws = usual_flaws();
      flaws.latency_s = latency_s, flaws.delay_known = known;
      const auto done = run(flaws, sinusoids(paper_sinusoids()), 30, 7);
      EXPECT_LT(settled_s(done), 5);
      EXPECT_NEAR(done.back().step.delay_s, latency_s, 0.5 / 60);
      const Eigen::Vector4d rms = rms_after(done, 10);
      if (latency_s == 0) rms_at_zero = rms;
      EXPECT_LT(rms.cwiseQuotient(rms_at_zero).maxCoeff(), latency_s <= 0.15 ? 1.2 : INFINITY);
    }
  }
}

TEST(VisualController, CopesWithDroppedFramesFastStepsAndTheirJitter) {
  Flaws flaws = usual_flaws();
  flaws.dropped = 0.1, flaws.frame_every = 4, flaws.jitter_s = 0.001;
  for (const bool known : {true, false}) {
    flaws.delay_known = known;
    ControllerConfig config = testing::test_config(flaws);
    config.period_s = 1.0 / 240;
    const auto done = run(config, testing::model_of({}), flaws, sinusoids(paper_sinusoids()), 15, 5);
    EXPECT_LT(settled_s(done), 5);
    EXPECT_LT(rms_after(done, 6).tail<3>().maxCoeff(), 0.3);
  }
}

struct Holds {
  int changes = 0;  ///< of the reason
  double slow_s = 0, stale_s = 0;
};

// From 2 s to 22 s, one image in so many periods, with jitter and pauses of 0.3 s about every `pause_s`.
Holds holds_at(long frame_every, double pause_s, std::uint64_t seed) {
  Flaws flaws = usual_flaws();
  flaws.frame_every = frame_every, flaws.jitter_s = 0.005;
  Random random(seed);
  double pause_s_at = pause_s > 0 ? 1 : 1e9;
  flaws.lost = [=](double time_s) mutable {
    if (time_s > pause_s_at + 0.3) pause_s_at += 0.3 + random.uniform(0.5, 1.5) * pause_s;
    return time_s >= pause_s_at && time_s < pause_s_at + 0.3;
  };
  const auto done = run(flaws, set_point(paper_sinusoids().offset), 22, seed);
  Holds holds;
  for (std::size_t k = 120; k < done.size(); ++k) {
    const HoldReason before = done[k - 1].step.reason, now = done[k].step.reason;
    holds.changes += now != before;
    holds.slow_s += now == HoldReason::slow_images ? 1.0 / 60 : 0;
    holds.stale_s += now == HoldReason::stale_image ? 1.0 / 60 : 0;
  }
  return holds;
}

// Fewer than ten images a second are held once, not by turns.
TEST(VisualController, HoldsOnceWhereImagesAreTooFew) {
  const Holds few = holds_at(8, 0, 1);
  EXPECT_EQ(few.changes, 0);
  EXPECT_NEAR(few.slow_s, 20, 0.1);
  const Holds enough = holds_at(5, 0, 1);
  EXPECT_EQ(enough.changes, 0);
  EXPECT_EQ(enough.slow_s + enough.stale_s, 0);
}

// At 15 images a second a pause holds while it lasts, however frequent pauses are.
TEST(VisualController, PausesBetweenEnoughImagesAreNoSlowImages) {
  for (const double pause_s : {4.0, 1.0, 0.5})
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Holds holds = holds_at(4, pause_s, seed);
      EXPECT_EQ(holds.slow_s, 0) << pause_s << ", seed " << seed;
      EXPECT_GT(holds.stale_s, 0);
    }
}

TEST(VisualController, SendsNothingBeforeTheFirstMeasuredJoints) {
  VisualController controller({}, testing::model_of({}));
  const auto nothing = controller.step(0, Eigen::Vector4d::Constant(NAN), {}, {});
  EXPECT_EQ(nothing.reason, HoldReason::non_finite);
  EXPECT_FALSE(nothing.has_setpoint);
  const Eigen::Vector4d q(0.05, 1.57, 0.064, 1);
  const auto first = controller.step(0.1, q, {}, {});
  EXPECT_TRUE(first.has_setpoint);
  EXPECT_EQ(first.setpoint.position, q);
}

// Nor do those that make up in the image for a joint at its limit; the first image of a motion is later than all this.
TEST(VisualController, NoJointIsFasterThanImagesHaveConfirmed) {
  Flaws flaws = usual_flaws();
  flaws.latency_s = 0.25;
  double fastest = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    ControllerConfig config = testing::test_config(flaws);
    Random random(seed);
    const Eigen::Vector4d start = testing::random_start({}, config, flaws, random),
                          rate = ImageResponse::unconfirmed_rate(config.limits);
    config.limits.lower[2] = start[2];
    const Eigen::Vector4d beyond = start + flaws.offset - 0.01 * Eigen::Vector4d::UnitZ();
    const Trajectory goal = set_point(testing::exact_map(TestRig(), beyond).value().features);
    VisualController controller(config, testing::model_of({}));
    for (const Moment& m : TestSimulator({}, flaws, start, seed).run(controller, goal, 0.5))
      fastest = std::max(fastest, m.step.velocity.cwiseAbs().cwiseQuotient(rate).maxCoeff());
  }
  EXPECT_NEAR(fastest, 1, 1e-9);
}

// Goals beyond a joint's limit, which is on the way or where the arm starts, are said until another goal is given, or
// until a start where the way along the limit leads past the marker's seam; those on limits are reached.
TEST(VisualController, SaysWhichLimitKeepsItFromItsGoal) {
  const Flaws flaws = usual_flaws();
  int said = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE(seed);
    ControllerConfig config = testing::test_config(flaws), tight = config;
    Random random(seed);
    const Eigen::Vector4d start = testing::random_start({}, config, flaws, random),
                          there = testing::random_start({}, config, flaws, random);
    const auto goal = [&](const Eigen::Vector4d& q) {
      return set_point(testing::exact_map(TestRig(), q + flaws.offset).value().features);
    };
    tight.limits.lower = start.cwiseMin(there), tight.limits.upper = start.cwiseMax(there);
    VisualController reaches(tight, testing::model_of({}));
    const auto reached = TestSimulator({}, flaws, start, seed).run(reaches, goal(there), 15);
    for (const Moment& m : reached) ASSERT_NE(m.step.reason, HoldReason::goal_beyond_limit) << m.time_s;
    EXPECT_LT(settled_s(reached), 14);

    Eigen::Index joint = 0;
    (there - start).cwiseQuotient(config.scales.joints).cwiseAbs().maxCoeff(&joint);
    const bool upper = there[joint] > start[joint];
    (upper ? config.limits.upper : config.limits.lower)[joint] =
        seed % 2 ? start[joint] : (start[joint] + there[joint]) / 2;
    VisualController controller(config, testing::model_of({}));
    TestSimulator simulator({}, flaws, start, seed);
    const Moments moments = simulator.run(controller, goal(there), 15);
    const Moment& held = moments.back();
    EXPECT_TRUE(held.step.velocity.isZero());
    ASSERT_TRUE(held.step.stops_at);
    EXPECT_EQ(std::pair(held.step.stops_at->of, held.step.stops_at->upper), std::pair(joint, upper));
    if (held.step.reason == HoldReason::error_grows) continue;
    ASSERT_EQ(held.step.reason, HoldReason::goal_beyond_limit);
    ++said;
    for (std::size_t k = 1; k + 60 < moments.size(); ++k) {
      const Eigen::Vector4d change = (moments[k].step.velocity - moments[k - 1].step.velocity) / config.period_s;
      const bool ends = moments[k].step.reason == HoldReason::none && moments[k + 60].step.reason != HoldReason::none;
      ASSERT_LE(ends * change.cwiseQuotient(config.limits.acceleration).cwiseAbs().maxCoeff(), 0.5) << "it trembles";
    }
    EXPECT_EQ(simulator.run(controller, goal(start), 0.1).front().step.reason, HoldReason::none);
  }
  EXPECT_GE(said, 23);
}

TestRig wrong_rig(Random& random) {
  TestRig rig;
  const double focal = random.uniform(0.8, 1.2);
  rig.camera.fx_px *= focal, rig.camera.fy_px *= focal, rig.marker.diameter_m *= random.uniform(0.95, 1.05);
  const Eigen::Vector3d axis(random.normal(), random.normal(), random.normal());
  rig.camera_from_rcm.rotation =
      rig.camera_from_rcm.rotation * Eigen::AngleAxisd(rad_from_deg(random.uniform(-10, 10)), axis.normalized());
  for (int i = 0; i < 3; ++i) rig.camera_from_rcm.translation[i] += random.uniform(-0.01, 0.01);
  return rig;
}

TEST(VisualController, ConvergesInTheImageWithAWrongModelAndBacklash) {
  for (const bool gaps : {false, true})
    for (std::uint64_t seed = 1; seed <= (gaps ? 20 : 40); ++seed) {
      SCOPED_TRACE(seed);
      Flaws flaws = gaps ? usual_flaws({0, 0, 0.0002, 0.03}) : usual_flaws();
      flaws.delay_known = seed % 2 == 0;
      ControllerConfig config = testing::test_config(flaws);
      config.model_error = 2;
      Random random(1000 + seed);
      const FeatureModel model = testing::model_of(wrong_rig(random));
      const double within_s = gaps ? 9 : 8;
      const auto done = run(config, model, flaws, set_point(paper_sinusoids().offset), within_s + 3, seed);
      EXPECT_LT(settled_s(done), within_s);
    }
}

// By the paper's swings at paces that differ: one joint turns at a time, and what its backlash does shows most.
TEST(VisualController, LearnsBacklashSoThatReversalsLeaveLittleError) {
  Sinusoids one_joint_at_a_time = paper_sinusoids();
  one_joint_at_a_time.omega_rad_s = {0.52, 0.63, 0.45, 0.70};
  const auto trajectory = sinusoids(one_joint_at_a_time);
  Eigen::Vector4d rms_at_zero = Eigen::Vector4d::Zero();
  for (const bool known : {true, false}) {
    for (const double latency_s : {0.0, 0.08, 0.15, 0.25}) {
      SCOPED_TRACE(std::string(known ? "known " : "estimated ") + std::to_string(latency_s));
      Flaws flaws = usual_flaws({0, 0, 0.0001, 0.02});
      flaws.latency_s = latency_s, flaws.delay_known = known;
      ControllerConfig unlearnt = testing::test_config(flaws);
      unlearnt.observer.backlash.largest.setZero();
      const auto done = run(flaws, trajectory, 40, 3),
                 before = run(unlearnt, testing::model_of({}), flaws, trajectory, 40, 3);
      const Eigen::Vector4d width = done.back().step.estimate->gap.width;
      for (const int i : {2, 3}) EXPECT_NEAR(width[i], flaws.backlash[i], 0.15 * flaws.backlash[i]) << i;
      EXPECT_TRUE(width.head<2>().isZero());
      const Eigen::Vector4d rms = rms_after(done, 15), rms_unlearnt = rms_after(before, 15);
      EXPECT_LT(rms[1], rms_unlearnt[1] / 4);
      EXPECT_LT(rms[3], rms_unlearnt[3] / 3);
      if (latency_s == 0) rms_at_zero = rms;
      if (latency_s <= 0.15) {
        EXPECT_LT(rms.cwiseQuotient(rms_at_zero).maxCoeff(), 1.2);
      }
    }
  }
}

TEST(VisualController, RestsAtASetPointWithBacklashLearnt) {
  const Flaws flaws = usual_flaws({0, 0, 0.0001, 0.02});
  const ControllerConfig config = testing::test_config(flaws);
  const TestRig rig;
  Random random(3);
  VisualController controller(config, testing::model_of(rig));
  TestSimulator simulator(rig, flaws, testing::random_start(rig, config, flaws, random), 3);
  simulator.run(controller, sinusoids(paper_sinusoids()), 30);
  const auto still = simulator.run(controller, set_point(paper_sinusoids().offset), 30);
  EXPECT_GT(still.back().step.estimate->gap.width[3], 0.015);
  EXPECT_LT(rms_after(still, 40).tail<3>().maxCoeff(), 0.1);
  // Motors don't go to and fro through their gaps: in 20 s psi travels less than a few widths.
  double travel = 0;
  for (std::size_t k = 600; k < still.size(); ++k) travel += std::abs(still[k].step.velocity[3]) * config.period_s;
  EXPECT_LT(travel, 10 * flaws.backlash[3]);
}

TEST(VisualController, ConvergesUncalibratedFromRandomStarts) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Flaws flaws = usual_flaws({0, 0, 0.0001, 0.02});
    flaws.delay_known = seed % 2 == 0, flaws.latency_s = 0.02 * static_cast<double>(seed % 10);
    ControllerConfig config = testing::test_config(flaws);
    config.mode = ControlMode::uncalibrated;
    const auto done = run(config, {}, flaws, set_point(paper_sinusoids().offset), 12, seed);
    EXPECT_LT(settled_s(done), 9);
    EXPECT_NEAR(done.back().step.delay_s, flaws.latency_s, 0.5 / 60);
  }
}

// Includes the motion beyond the window that the image's age allows; the window's margin covers it.
TEST(VisualController, ProbesInTheImageFromTheEdgeOfTheWindow) {
  constexpr double beside_px = 2;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE(seed);
    const Flaws flaws = usual_flaws();
    ControllerConfig config = testing::test_config(flaws);
    config.mode = ControlMode::uncalibrated;
    Random random(seed);
    const Eigen::Vector4d start = testing::random_start({}, config, flaws, random, beside_px);
    TestSimulator simulator({}, flaws, start, seed);
    VisualController controller(config, {});
    const auto moments = simulator.run(controller, set_point(paper_sinusoids().offset), 12);
    expect_in_image(moments);
    EXPECT_LT(settled_s(moments), 11);
  }
}

TEST(VisualController, OneWildReadingSpoilsNothing) {
  for (const Eigen::Vector4d& wild : {Eigen::Vector4d(0.09, 0, 0, 0), Eigen::Vector4d(0.5, -1, 0.05, 2)}) {
    Flaws flaws = usual_flaws();
    flaws.latency_s = 0.08, flaws.delay_known = false;
    flaws.misread = [&](double time_s) {
      return std::abs(time_s - 6) < 0.5 / 60 ? wild : Eigen::Vector4d(Eigen::Vector4d::Zero());
    };
    const auto done = run(flaws, sinusoids(paper_sinusoids()), 8, 1);
    EXPECT_NEAR(done.back().step.delay_s, 0.08, 0.005);
    int held = 0;
    for (const Moment& m : done) {
      if (m.time_s < 5) continue;
      held += m.step.reason == HoldReason::wild_joints;
      EXPECT_LT(std::abs(m.error[0]), 2e-3) << m.time_s;
      EXPECT_LT(m.error.tail<3>().cwiseAbs().maxCoeff(), 2) << m.time_s;
    }
    EXPECT_EQ(held, 1);
  }
}

// A reading may come after the tick that it belongs to, and a tick without any say nothing new.
TEST(VisualController, KeepsReadingsThatComeATickLate) {
  const ControllerConfig config = testing::test_config({});
  VisualController controller(config, testing::model_of({}));
  const auto q_at = [](double t) { return Eigen::Vector4d(0.1 * t, 1.57, 0.064, 1.2); };
  const double read_ago_s = 0.004;
  double time_s = 0;
  for (int k = 0; k < 30; ++k, time_s += config.period_s) {
    const double read_s = time_s - read_ago_s;
    const JointReading reading{read_s, JointVector::from_vector(q_at(read_s))};
    const bool late = k % 3 == 1;
    const JointReading before{read_s - config.period_s, JointVector::from_vector(q_at(read_s - config.period_s))};
    std::vector<JointReading> readings;
    if (k % 3 == 2) readings.push_back(before);
    if (!late) readings.push_back(reading);
    controller.step(time_s, q_at(late ? before.time_s : read_s), {}, {}, readings);
  }
  for (double t = 0.1; t < 0.4; t += 0.01) {
    ImageMeasurement image;
    image.time_s = t + controller.delay_s();
    EXPECT_NEAR(controller.measured_at(image).value()[0], q_at(t)[0], 1e-9) << t;
  }
}

TEST(VisualController, ATickWithoutAReadingMakesTheNextOneNoJump) {
  const ControllerConfig config = testing::test_config({});
  VisualController controller(config, testing::model_of({}));
  controller.expect_following(false);
  Eigen::Vector4d measured;
  for (int k = 0; k < 60; ++k) {
    const double time_s = k * config.period_s;
    std::vector<JointReading> readings;
    if (k % 5 != 4) {
      measured = Eigen::Vector4d(-0.2, 1.4, 0.05, -0.5) + 0.95 * time_s * config.limits.rate;
      readings.push_back({time_s, JointVector::from_vector(measured)});
    }
    EXPECT_NE(controller.step(time_s, measured, {}, {}, readings).reason, HoldReason::wild_joints) << time_s;
  }
}

// The arm stands, and so does an image without noise, once the measured joints reach back to before it.
TEST(VisualController, JointsThatWereSetFreezeNoPicture) {
  const ControllerConfig config = testing::test_config({});
  const FeatureModel model = testing::model_of({});
  VisualController controller(config, model);
  const Eigen::Vector4d q(0.05, 1.57, 0.064, 1.2);
  FeatureState seen = model(q).value();
  DesiredFeatures desired;
  desired.features = seen.features;
  HoldReason reason = HoldReason::none;
  for (int k = 0; k < 120; ++k) {
    const double time_s = k * config.period_s;
    if (k == 30) seen.features[1] += 1;
    const ImageMeasurement image{true, time_s, seen.features, 1e-4 * Eigen::Matrix4d::Identity(), seen.ends_px, {}};
    const Eigen::Vector4d measured = q + (k < 60 ? 0.0 : 0.05) * Eigen::Vector4d::UnitX();
    controller.reset(time_s, measured);  // not enabled: it does not move
    reason = controller.step(time_s + 1e-6, measured, image, desired).reason;
  }
  EXPECT_NE(reason, HoldReason::frozen_image);
}

// Images that were taken during a pause of the joints' readings, and come after it: the arm stood still until its end.
TEST(VisualController, APauseOfTheJointsFreezesNoPicture) {
  constexpr double pause_s = 1, end_s = 1.4, latency_s = 0.1;
  const ControllerConfig config = testing::test_config({});
  const FeatureModel model = testing::model_of({});
  VisualController controller(config, model);
  controller.expect_following(false);
  const auto q_at = [](double t) { return Eigen::Vector4d(t < end_s ? 0.05 : 0.053, 1.57, 0.064, 1.2); };
  DesiredFeatures desired;
  desired.features = model(q_at(0)).value().features;
  Eigen::Vector4d measured = q_at(0);
  for (int k = 0; k < 120; ++k) {
    const double time_s = k * config.period_s, image_s = time_s - latency_s;
    std::vector<JointReading> readings;
    if (time_s < pause_s || time_s >= end_s) {
      measured = q_at(time_s);
      readings.push_back({time_s, JointVector::from_vector(measured)});
    }
    const auto image = testing::image_of(model(q_at(image_s)).value(), image_s);
    EXPECT_NE(controller.step(time_s, measured, image, desired, readings).reason, HoldReason::frozen_image) << time_s;
  }
}

// The first image after a pause was taken before it, and has the stamp of its arrival.
TEST(VisualController, AnImageThatAPauseKeptBackIsNoFault) {
  constexpr double from_s = 5;
  for (const double to_s : {5.3, 5.4, 5.6}) {
    Flaws flaws = usual_flaws();
    flaws.spoil = [=](ImageMeasurement image) {
      if (image.time_s > from_s && image.time_s < to_s) image.time_s = to_s;
      return image;
    };
    flaws.lost = [=, &flaws](double t) { return t + flaws.latency_s > from_s + 0.02 && t + flaws.latency_s < to_s; };
    Sinusoids fast = paper_sinusoids();
    fast.omega_rad_s.setConstant(1);
    for (const Moment& m : run(flaws, sinusoids(fast), to_s + 2, 1))
      EXPECT_NE(m.step.reason, HoldReason::image_not_following) << to_s << ' ' << m.time_s;
  }
}

TEST(VisualController, ADelayThatChangesIsForgottenAndFoundAnew) {
  constexpr double at_s = 12, noticed_s = 5, found_s = 8;
  for (const auto& [before_s, after_s] : {std::pair(0.05, 0.2), {0.2, 0.05}, {0.08, 0.13}}) {
    Flaws flaws = usual_flaws();
    flaws.delay_known = false, flaws.latency_s = before_s;
    flaws.spoil = [=, changed_s = after_s - before_s](ImageMeasurement image) {
      if (image.time_s > at_s) image.time_s += changed_s;
      return image;
    };
    for (const Moment& m : run(flaws, sinusoids(paper_sinusoids()), at_s + found_s + 4, 1)) {
      const bool is_right = std::abs(m.step.delay_s - after_s) < 0.02, is_known = m.step.delay_is_known;
      EXPECT_TRUE(is_known || m.time_s < at_s - 2 || m.time_s > at_s) << m.time_s;
      EXPECT_TRUE(is_right || !is_known || m.time_s < at_s + noticed_s) << m.time_s << ": " << m.step.delay_s;
      EXPECT_TRUE((is_right && is_known) || m.time_s < at_s + found_s) << m.time_s << ": " << m.step.delay_s;
    }
  }
}

class Holding : public ::testing::TestWithParam<ControlMode> {
 protected:
  ControllerConfig config_for(const Flaws& flaws) const {
    ControllerConfig config = testing::test_config(flaws);
    config.mode = GetParam();
    if (config.mode == ControlMode::paper) config.gains.per_s.setConstant(0.8);
    return config;
  }

  const TestRig rig;
  const Eigen::Vector4d q{0.05, 1.57, 0.064, 1};
  const FeatureState state = exact_map(rig, q).value();
  const DesiredFeatures desired{state.features, Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
};

TEST_P(Holding, WithinAPeriodWhenTheMarkerIsHiddenAndResumesWithoutAJump) {
  Flaws flaws = usual_flaws();
  flaws.hidden = [](double t) { return t > 8 && t < 10; };
  const ControllerConfig config = config_for(flaws);
  const auto done = run(config, testing::model_of({}), flaws, sinusoids(paper_sinusoids()), 25, 4);
  const double period_s = config.period_s;
  for (const Moment& m : done) {
    const double shown_s = m.time_s - flaws.latency_s;
    if (shown_s > 8 + 1.1 * period_s && shown_s < 10 - 0.1 * period_s) {
      ASSERT_EQ(m.step.action, ControlAction::hold) << m.time_s;
      ASSERT_EQ(m.step.reason, HoldReason::marker_lost) << m.time_s;
      if (shown_s > 8.3) {
        ASSERT_TRUE(m.step.velocity.isZero()) << m.time_s;
      }
    }
    if (shown_s > 10.2) {
      ASSERT_EQ(m.step.action, ControlAction::track) << m.time_s;
    }
  }
  if (GetParam() == ControlMode::fused) {
    EXPECT_LT(settled_s(done), 15);
  }
}

TEST_P(Holding, NamesEveryReason) {
  const ControllerConfig config = config_for({});
  VisualController controller(config, testing::model_of(rig));
  double t = 0;
  const auto image_at = [&](double stamp_s) { return testing::image_of(state, stamp_s); };
  const auto step = [&](const std::optional<ImageMeasurement>& image) {
    t += config.period_s;
    const auto result = controller.step(t, q, image, desired);
    EXPECT_EQ(result.action == ControlAction::hold, result.reason != HoldReason::none);
    EXPECT_TRUE(result.velocity.allFinite());
    return result.reason;
  };
  const auto good = [&] { return step(image_at(t + config.period_s)); };
  const auto once = [&](const std::optional<ImageMeasurement>& image, HoldReason reason) {
    EXPECT_EQ(step(image), reason);
    EXPECT_EQ(good(), HoldReason::none);
  };
  EXPECT_EQ(step({}), HoldReason::no_image_yet);
  for (int k = 0; k < 30; ++k) step(image_at(t));
  EXPECT_EQ(good(), HoldReason::none);
  EXPECT_TRUE(controller.delay_is_known()) << "it is given";
  ControllerConfig not_given = config;
  not_given.observer.delay_s.reset();
  EXPECT_FALSE(VisualController(not_given, testing::model_of(rig)).delay_is_known());
  EXPECT_EQ(step({}), HoldReason::none) << "one frame without news is no reason";
  ImageMeasurement lost = image_at(t);
  lost.found = false;
  EXPECT_EQ(step(lost), HoldReason::marker_lost);
  EXPECT_EQ(step({}), HoldReason::marker_lost) << "until the next image";
  EXPECT_EQ(good(), HoldReason::none);
  ImageMeasurement bad = image_at(t);
  bad.features[2] = NAN;
  once(bad, HoldReason::non_finite);
  once(image_at(t - 5), HoldReason::stale_image);
  for (int k = 0; k < 4; ++k) step({});
  EXPECT_EQ(step({}), HoldReason::none);
  once({}, HoldReason::stale_image);
  if (GetParam() == ControlMode::fused) {
    ImageMeasurement outlier = image_at(t + config.period_s);
    outlier.features[2] += 80;
    once(outlier, HoldReason::outlier);
  }
  const auto reason_for = [&](double time_s, const Eigen::Vector4d& joints, const DesiredFeatures& wanted) {
    return controller.step(time_s, joints, {}, wanted).reason;
  };
  EXPECT_EQ(reason_for(t, q, desired), HoldReason::bad_time);
  EXPECT_EQ(reason_for(t - 1, q, desired), HoldReason::bad_time);
  EXPECT_EQ(reason_for(NAN, q, desired), HoldReason::non_finite);
  EXPECT_EQ(reason_for(t += config.period_s, Eigen::Vector4d::Constant(NAN), desired), HoldReason::non_finite);
  EXPECT_EQ(reason_for(t += config.period_s, q, desired), HoldReason::none);
  DesiredFeatures wild = desired;
  wild.rate[1] = INFINITY;
  EXPECT_EQ(reason_for(t += config.period_s, q, wild), HoldReason::non_finite);
  wild.hold = HoldReason::tip_open;
  EXPECT_EQ(reason_for(t += config.period_s, q, wild), HoldReason::tip_open);
  EXPECT_EQ(reason_for(t += config.period_s, q + Eigen::Vector4d(0, 0.5, 0, 0), desired), HoldReason::wild_joints);
}

TEST_P(Holding, AnImageOfAnOldStampIsNotFresh) {
  const ControllerConfig config = config_for({});
  VisualController controller(config, testing::model_of(rig));
  ImageMeasurement image = testing::image_of(state, 0);
  HoldReason reason = HoldReason::none, fresh = reason;
  for (int k = 1; k <= 60; ++k) {
    image.time_s = std::min(k, 40) * config.period_s;
    reason = controller.step(k * config.period_s, q, image, desired).reason;
    if (k <= 40) fresh = reason;
  }
  EXPECT_EQ(fresh, HoldReason::none);
  EXPECT_EQ(reason, HoldReason::stale_image);
}

// Another command source moves it, faster and farther than its own setpoints would: 0.4 rad to and fro.
TEST_P(Holding, NotForAnArmThatIsOnlyObserved) {
  const ControllerConfig config = config_for({});
  const auto led = [&](bool follows, std::set<HoldReason>& reasons) {
    VisualController controller(config, testing::model_of(rig));
    controller.expect_following(follows);
    double most_ahead = 0;
    for (int k = 0; k < 240; ++k) {
      const double t = k * config.period_s;
      const Eigen::Vector4d led_q(0.2 * std::sin(1.5 * t), 1.57, 0.064, 1);
      const ControlStep step = controller.step(t, led_q, testing::image_of(exact_map(rig, led_q).value(), t), desired);
      if (k > 30) reasons.insert(step.reason);
      most_ahead = std::max(most_ahead,
                            (step.setpoint.position - led_q).cwiseQuotient(config.limits.rate).cwiseAbs().maxCoeff());
    }
    return most_ahead;
  };
  std::set<HoldReason> reasons;
  EXPECT_LE(led(false, reasons), config.period_s) << "no farther than a period's motion";
  EXPECT_EQ(reasons, std::set{HoldReason::none});
  led(true, reasons);
  EXPECT_TRUE(reasons.contains(HoldReason::not_following));
}

INSTANTIATE_TEST_SUITE_P(Modes, Holding, ::testing::Values(ControlMode::fused, ControlMode::paper),
                         [](const auto& mode) { return std::string(to_string(mode.param)); });

TEST(VisualController, NothingMakesItLeaveItsLimits) {
  for (const ControlMode mode : {ControlMode::fused, ControlMode::paper, ControlMode::uncalibrated}) {
    for (std::uint64_t seed = 1; seed <= 15; ++seed) {
      SCOPED_TRACE(std::string(to_string(mode)) + " seed " + std::to_string(seed));
      Random chance(seed);
      Flaws flaws = usual_flaws();
      flaws.hidden = [&](double) { return chance.uniform() < 0.1; };
      flaws.spoil = [&](ImageMeasurement image) {
        const double what = chance.uniform();
        if (what < 0.03) image.features[static_cast<int>(chance.uniform(0, 4))] = NAN;
        if (what > 0.03 && what < 0.06) image.features *= chance.uniform(-3, 3);
        if (what > 0.06 && what < 0.08) image.covariance.setZero();
        if (what > 0.08 && what < 0.1) image.covariance.setConstant(NAN);
        if (what > 0.1 && what < 0.12) image.ends_px[0] = 1e9;
        return image;
      };
      ControllerConfig config = testing::test_config(flaws);
      config.mode = mode;
      config.gains.per_s.setConstant(chance.uniform(0.5, 10));
      if (mode == ControlMode::paper) config.observer.delay_s = 0;  // it is not: such gains are refused
      Sinusoids wild = paper_sinusoids();
      wild.amplitude *= 20;
      run_anywhere(config, testing::model_of({}), flaws, sinusoids(wild), 15, seed);
    }
  }
}

TEST(VisualController, SaysWhatIsWrongWithAConfiguration) {
  using Change = std::function<void(ControllerConfig&)>;
  const std::vector<std::pair<Change, std::string>> wrongs{
      {[](ControllerConfig& c) { c.gains.per_s[2] = -1; }, "gains_per_s[2]: is -1"},
      {[](ControllerConfig& c) { c.limits.rate[0] = 0; }, "limits.rate[0]"},
      {[](ControllerConfig& c) { c.limits.upper[1] = c.limits.lower[1]; }, "limits.upper[1]"},
      {[](ControllerConfig& c) { c.limits.upper[2] = 229; }, "/ 2[2]: is 114.485000, expected metres within 1 for"},
      {[](ControllerConfig& c) { c.period_s = 0; }, "period_s"},
      {[](ControllerConfig& c) { c = paper_controller(1.0 / 60), c.gains.per_s[1] = 3.7; },
       "gains_per_s[1]: is 3.700000, expected at most 3.67 per second: mode paper takes images that are 0.100 s late"},
      {[](ControllerConfig& c) { c = paper_controller(1.0 / 60), c.observer.delay_s = 0.2; }, "at most 1.83 per"},
      {[](ControllerConfig& c) { c.observer.delay_s = 1; }, "controller: delay_s: is 1"}};
  for (const auto& [change, word] : wrongs) {
    ControllerConfig config;
    change(config);
    const std::string said = testing::input_error([&] { VisualController(config, testing::model_of({})); });
    EXPECT_NE(said.find(word), std::string::npos) << word << " in: " << said;
  }
  EXPECT_THROW(VisualController({}, {}), InputError) << "a model is needed";
}

}  // namespace lapservo::internal::visual_controller_test
