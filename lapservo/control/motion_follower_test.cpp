#include "lapservo/control/motion_follower.h"

#include <functional>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::motion_follower_test {

using Progress = MotionFollower::Progress;
constexpr double tick_s = 0.002;
const Eigen::Vector4d start(0, 1.5, 0.1, 0), max_lead(0.05, 0.05, 0.005, 0.2);

// An arm that follows its setpoints with a lag.
struct SimulatedRun {
  double now_s = 0;
  Eigen::Vector4d q = start, set_point = start, velocity = Eigen::Vector4d::Zero();
  std::optional<JointPath> path;
  Eigen::Array4d max_rate = Eigen::Array4d::Zero(), max_acceleration = Eigen::Array4d::Zero();
  std::vector<Eigen::Vector4d> set_points;

  void tick(const std::function<void(SimulatedRun&)>& disturb) {
    now_s += tick_s;
    const Eigen::Vector4d next = path ? path->at(now_s).position : set_point;
    const Eigen::Vector4d v = (next - set_point) / tick_s;
    max_rate = max_rate.max(v.array().abs());
    max_acceleration = max_acceleration.max((v - velocity).array().abs() / tick_s);
    set_point = next, velocity = v;
    set_points.push_back(next);
    q += tick_s / 0.03 * (set_point - q);
    disturb(*this);
  }
};

// Runs to the end; `misread` changes the measured joints.
Progress follow(MotionFollower& follower, SimulatedRun& run, const std::function<void(SimulatedRun&)>& disturb,
                const std::function<void(const SimulatedRun&, JointVector&)>& misread) {
  for (int i = 0; i < 100000; ++i) {
    for (int k = 0; k < 5; ++k) run.tick(disturb);
    JointVector measured = JointVector::from_vector(run.q);
    misread(run, measured);
    const auto step = follower.step(run.now_s, measured);
    if (step.path) run.path = step.path;
    if (step.progress != Progress::moving) {
      for (int k = 0; k < 500; ++k) run.tick(disturb);  // it brakes
      return step.progress;
    }
  }
  ADD_FAILURE() << "it never ends";
  return Progress::moving;
}
// The swing of 10 s that is followed.
const JointLimits limits;
MotionFollower follower_of_a_swing() {
  return MotionFollower(swing_motion(start, limits, 1, 10), limits, max_lead, 0);
}

const auto undisturbed = [](SimulatedRun&) {};
const auto as_it_is = [](const SimulatedRun&, JointVector&) {};

void expect_within(const SimulatedRun& run) {
  EXPECT_TRUE((run.max_rate <= 1.001 * limits.rate.array()).all()) << run.max_rate.transpose();
  EXPECT_TRUE((run.max_acceleration <= 1.05 * limits.acceleration.array()).all()) << run.max_acceleration.transpose();
}

TEST(MotionFollower, LeadsAnArmToTheEnd) {
  MotionFollower follower = follower_of_a_swing();
  SimulatedRun run;
  EXPECT_EQ(follow(follower, run, undisturbed, as_it_is), Progress::done);
  EXPECT_LT((run.q - start).cwiseAbs().maxCoeff(), 2e-3);
  Eigen::Vector4d reach = Eigen::Vector4d::Zero();
  for (const Eigen::Vector4d& q : run.set_points) reach = reach.cwiseMax((q - start).cwiseAbs());
  EXPECT_GT(reach[0], 0.1);
  expect_within(run);
}

TEST(MotionFollower, GoesOnFromRestAfterAPause) {
  for (const double begin_s : {1.0, 2.2, 3.7, 5.1}) {
    MotionFollower follower = follower_of_a_swing();
    SimulatedRun run;
    while (run.now_s < begin_s) {
      run.path = follower.step(run.now_s, JointVector::from_vector(run.q)).path;
      for (int k = 0; k < 5; ++k) run.tick(undisturbed);
    }
    for (int k = 0; k < 500; ++k) run.tick(undisturbed);  // it brakes
    run.set_point = run.q;
    follower.resume(run.now_s, JointVector::from_vector(run.q));
    EXPECT_EQ(follow(follower, run, undisturbed, as_it_is), Progress::done) << begin_s;
    EXPECT_GT(run.now_s, 11);
    EXPECT_TRUE((run.max_rate <= 1.001 * limits.rate.array()).all()) << run.max_rate.transpose();
  }
}

TEST(MotionFollower, LetsGoOfWhatItRunsAgainst) {
  MotionFollower follower = follower_of_a_swing();
  SimulatedRun run;
  std::optional<double> stuck;
  const auto blocked = [&](SimulatedRun& r) {
    if (r.now_s < 3) return;
    if (!stuck) stuck = r.q[0];
    r.q[0] = *stuck;
  };
  EXPECT_EQ(follow(follower, run, blocked, as_it_is), Progress::does_not_follow);
  EXPECT_LT(std::abs(run.set_point[0] - *stuck), 0.02);
  expect_within(run);
}

TEST(MotionFollower, OneWildReadingMovesNothing) {
  MotionFollower follower = follower_of_a_swing(), undisturbed_follower = follower_of_a_swing();
  SimulatedRun run, other;
  bool was_wild = false;
  const auto wild = [&](const SimulatedRun& r, JointVector& q) {
    if (r.now_s < 2 || was_wild) return;
    q.theta_rad += 0.5, was_wild = true;
  };
  EXPECT_EQ(follow(follower, run, undisturbed, wild), Progress::done);
  EXPECT_EQ(follow(undisturbed_follower, other, undisturbed, as_it_is), Progress::done);
  ASSERT_EQ(run.set_points.size(), other.set_points.size());
  for (std::size_t i = 0; i < run.set_points.size(); ++i) EXPECT_EQ(run.set_points[i], other.set_points[i]) << i;
}

}  // namespace lapservo::internal::motion_follower_test
