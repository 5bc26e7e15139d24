#include "lapservo/sim/simulator.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/sim/test_edge_probe.h"
#include "lapservo/testing/sample_frames.h"

namespace lapservo::internal::simulator_test {

// The example's scene, a third as large.
Rig small_rig() {
  Rig rig = load_rig(testing::source_folder() / "configs/example.yaml");
  rig.camera = {426, 240, 366, 366, 212.5, 119.5, {}, {}};
  return rig;
}

JointVector in_view(const Rig& rig) {
  JointVector q = configuration_through(*rig.instruments[0].camera_from_rcm, {-0.012, 0.004, 0.1}).value();
  q.psi_rad = 0.6;
  return q;
}

SimulatorConfig without_offsets() {
  SimulatorConfig config;
  config.arm.joint_offset.setZero();
  config.arm.backlash.setZero();
  return config;
}

SimulatorConfig without_pictures(SimulatorConfig config) {
  config.endoscope.pictures = false;
  return config;
}

CentreLine line_in(const Rig& rig, const SimulatedFrame& frame) {
  const Instrument& instrument = rig.instruments[0];
  const Rigid3 pose = *instrument.camera_from_rcm * rcm_from_unrolled(frame.q);
  return centre_line(rig.camera, instrument.marker, pose, frame.q.psi_rad).value();
}

// A slow sweep at 1 kHz.
std::vector<SimulatedFrame> sweep(Simulator& simulator, const JointVector& from, double duration_s) {
  std::vector<SimulatedFrame> seen;
  const auto ticks = static_cast<int>(std::lround(duration_s * 1000));
  for (int k = 0; k < ticks; ++k) {
    const double phase = 3 * simulator.now_s();
    simulator.servo_jp(from.vector() + std::sin(phase) * Eigen::Vector4d(0.04, 0.03, 0.004, 0.3));
    simulator.step(0.001);
    for (SimulatedFrame& frame : simulator.arrived()) seen.push_back(std::move(frame));
  }
  return seen;
}

TEST(Simulator, IsTheSameBitForBitWhateverThreadsRender) {
  const Rig rig = small_rig();
  std::vector<std::vector<SimulatedFrame>> runs;
  for (const int threads : {0, 1, 2, 1}) {
    SimulatorConfig config;
    config.endoscope.render_threads = threads;
    config.endoscope.exposure_s = 0.004;
    config.endoscope.dropped_fraction = 0.1;
    if (runs.size() == 3) config.seed = 2;
    Simulator simulator(rig, config, in_view(rig));
    runs.push_back(sweep(simulator, in_view(rig), 0.7));
  }
  ASSERT_GT(runs[0].size(), 20U);
  for (const std::size_t other : {1, 2}) {
    ASSERT_EQ(runs[other].size(), runs[0].size());
    for (std::size_t k = 0; k < runs[0].size(); ++k) {
      const EndoscopePicture &a = runs[0][k].picture, &b = runs[other][k].picture;
      EXPECT_EQ(a.stamp_s, b.stamp_s);
      EXPECT_EQ(cv::norm(a.bgr, b.bgr, cv::NORM_INF), 0) << k;
      EXPECT_EQ(runs[0][k].q.vector(), runs[other][k].q.vector());
    }
  }
  EXPECT_GT(cv::norm(runs[0][0].picture.bgr, runs[3][0].picture.bgr, cv::NORM_INF), 0);
}

TEST(Simulator, StepsOfAnyLengthGiveTheSameFrames) {
  const Rig rig = small_rig();
  const SimulatorConfig config = without_pictures({});
  Simulator coarse(rig, config, in_view(rig)), fine(rig, config, in_view(rig));
  const Eigen::Vector4d goal = in_view(rig).vector() + Eigen::Vector4d(0.05, 0.02, 0.01, 1);
  coarse.servo_jp(goal);
  fine.servo_jp(goal);
  coarse.step(0.5);
  for (int k = 0; k < 500; ++k) fine.step(0.001);
  const auto a = coarse.arrived(), b = fine.arrived();
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), 20U);
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a[k].picture.index, b[k].picture.index);
    EXPECT_LT((a[k].q.vector() - b[k].q.vector()).norm(), 1e-12);
  }
}

TEST(Simulator, TheTrueRcmLiesBesideTheRigsByItsOffset) {
  const Rig rig = small_rig();
  SimulatorConfig config = without_pictures({});
  Simulator simulator(rig, config, in_view(rig));
  config.arm.rcm_offset_m = {0.001, 0, -0.002};
  const Simulator moved(rig, config, in_view(rig));
  const Eigen::Vector3d by = rig.instruments[0].camera_from_rcm->rotation * config.arm.rcm_offset_m;
  const auto at = [](const Simulator& t) { return t.placement().camera_from_unrolled.translation; };
  EXPECT_LT((at(moved) - at(simulator) - by).norm(), 1e-12);
}

TEST(Simulator, TheMarkerIsHiddenWhileCoveredAndTheLightFollowsItsSetting) {
  const Rig rig = small_rig();
  SimulatorConfig config = without_offsets();
  config.endoscope.jitter_s = config.endoscope.dropped_fraction = 0;
  Simulator simulator(rig, config, in_view(rig));
  simulator.cover_marker({0.2, 0.3});
  const auto middle_of_band = [&](const SimulatedFrame& frame) {
    const CentreLine line = line_in(rig, frame);
    const cv::Mat light = light_of(frame.picture.bgr, rig.camera.response);
    return light_at(light, 0.5 * (line.ideal_px[0] + line.ideal_px[1]));
  };
  Light usual = Light::Zero();
  for (int k = 0; k < 480; ++k) {
    if (k == 305) simulator.set_light(0.5F);
    simulator.step(0.001);
    for (const SimulatedFrame& frame : simulator.arrived()) {
      const Light seen = middle_of_band(frame);
      const double at_s = frame.picture.exposed_s;
      if (usual.isZero()) usual = seen;
      if (at_s >= 0.2 - 1e-9 && at_s < 0.3 - 1e-9) {
        EXPECT_LT(seen.maxCoeff(), 0.35 * usual.maxCoeff()) << at_s;
      } else {
        const float expected = at_s > 0.305 ? 0.5F : 1.0F;
        EXPECT_NEAR(seen[2] / usual[2], expected, 0.1) << at_s;
      }
    }
  }
}

// Evenly, or smoothly from rest to rest: as far after all and half of the time.
TEST(Simulator, TheEndoscopeMovesByWhatItIsTold) {
  const Rig rig = small_rig();
  for (const auto& [profile, tenth] : {std::pair(MotionProfile::even, 0.1), {MotionProfile::smooth, 0.00856}}) {
    Simulator simulator(rig, without_pictures(without_offsets()), in_view(rig));
    const EndoscopeMotion motion{0.2, 0.4, {0.03, 0, -0.01}, {0, 0.3, 0.1}, profile};
    simulator.move_endoscope(motion);
    const Rigid3 first = simulator.placement().camera_from_unrolled;
    for (const auto& [dt_s, part] : {std::pair(0.1, 0.0), {0.14, tenth}, {0.16, 0.5}, {0.16, 1 - tenth}, {0.2, 1.0}}) {
      simulator.step(dt_s);
      const Rigid3 moved = simulator.camera_from_first_camera().inverse();
      EXPECT_LT((moved.translation - part * motion.translation_m).norm(), 1e-6) << part;
      EXPECT_NEAR(Eigen::AngleAxisd(moved.rotation).angle(), part * motion.rotation_rad.norm(), 1e-5) << part;
      EXPECT_LT((moved * simulator.placement().camera_from_unrolled.translation - first.translation).norm(), 1e-12);
    }
  }
}

TEST(Simulator, RefusesNonsense) {
  Rig rig = small_rig();
  rig.instruments[0].camera_from_rcm.reset();
  EXPECT_THROW(Simulator(rig, {}, {0, 1.5, 0.1, 0}), InputError);
  EXPECT_THROW(Simulator(small_rig(), {}, in_view(small_rig())).step(-0.1), std::invalid_argument);
  Simulator simulator(small_rig(), {}, in_view(small_rig()));
  EXPECT_THROW(simulator.move_endoscope({.begin_s = -1}), InputError);
  EXPECT_THROW(simulator.move_endoscope({.translation_m = {0, 2, 0}}), InputError);
  rig.instruments.clear();
  EXPECT_THROW(Simulator(rig, {}, {0, 1.5, 0.1, 0}), InputError);
}

TEST(Simulator, TheFirstJointOfAWristSwings) {
  Rig rig = small_rig();
  Tool& tool = rig.instruments[0].tool.emplace();
  tool.wrist.resize(4);
  SimulatorConfig config = without_pictures(without_offsets());
  config.wrist_swing_rad = 0.5;
  const auto wrist_at = [&](double time_s) {
    Simulator simulator(rig, config, in_view(rig));
    simulator.step(time_s);
    EXPECT_EQ(simulator.placement().wrist_rad, simulator.state().wrist_rad);
    return simulator.state().wrist_rad;
  };
  const std::vector<double> first = wrist_at(0), half_way = wrist_at(2);
  EXPECT_NEAR(half_way[0] - first[0], 0.5, 1e-9);
  EXPECT_NEAR(wrist_at(4)[0], first[0], 1e-9);
  EXPECT_EQ(half_way[3], first[3]);
  tool.snake_like = true;
  const std::vector<double> snake = wrist_at(2);
  EXPECT_EQ(snake[3], snake[0]);
  EXPECT_EQ(snake[2], snake[1]);
  rig.instruments[0].tool.reset();
  EXPECT_TRUE(wrist_at(0).empty());
}

}  // namespace lapservo::internal::simulator_test
