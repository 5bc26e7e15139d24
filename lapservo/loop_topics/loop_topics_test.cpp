#include "lapservo/loop_topics/loop_topics.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <set>
#include <thread>
#include <tuple>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_transport.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::loop_topics_test {

const JointVector there{0.05, 1.57, 0.064, 1.2};

ControlTick tick_of(const Rig& rig) {
  ControlTick tick;
  tick.input.time_s = 10.02;
  tick.input.desired.features = {0.9, 400, 180, 100};
  tick.decision.control.action = ControlAction::track;
  tick.decision.control.error = {0.001, 1, 2, 3};
  tick.decision.control.estimate.emplace();
  tick.seen.emplace();
  tick.seen->image = {10, cv::Mat(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar::all(40))};
  Observation seen;
  seen.status = Status::ok;
  seen.rcm = Observation::Rcm{there, Eigen::Vector4d(1e-6, 2e-6, 1e-8, 4e-6).asDiagonal()};
  tick.seen->observations = {seen};
  tick.seen->camera_from_rcm = rig.instruments.front().camera_from_rcm;
  tick.seen->measurement.found = true;
  tick.seen->measurement.features = {0.901, 401, 182, 103};
  return tick;
}

struct Loop {
  explicit Loop(bool hears = true) : topics(transport, rig, {}, hears) {}
  template <class Message>
  std::vector<Message> sent(const std::string& topic) {
    return transport.sent<Message>("/lapservo/PSM1/" + topic);
  }
  template <class Message>
  LoopWishes hear(const std::string& topic, const Message& message, double arm_silent_s = 0) {
    transport.say("/lapservo/PSM1/" + topic, message);
    return wishes(arm_silent_s);
  }
  LoopWishes wishes(double arm_silent_s = 0) { return topics.wishes(SteadyClock().now_s() - arm_silent_s); }
  void go_on(double duration_s) {
    for (const double end_s = SteadyClock().now_s() + duration_s; SteadyClock().now_s() < end_s; testing::sleep(0.05))
      wishes();
  }

  const Rig rig = testing::small_test_rig();
  TestTransport transport;
  LoopTopics topics;
};

const std::vector<std::string> names{"s_rad", "r_px", "l_px", "d_px"};

TEST(LoopTopics, TellsWhatWasSeenAndDecided) {
  Loop loop;
  loop.topics.publish(tick_of(loop.rig), "");
  EXPECT_TRUE(testing::wait_for([&] { return !loop.sent<CompressedImageMessage>("overlay/compressed").empty(); }));
  const auto observations = loop.sent<ObservationMessage>("observation");
  ASSERT_EQ(observations.size(), 1u);
  const ObservationMessage& seen = observations.front();
  EXPECT_NEAR(seen.stamp_s, loop.transport.stamp_s - 0.02, 1e-9);  // the stamp of the image, not of the message
  EXPECT_EQ(seen.status, "ok");
  EXPECT_EQ(seen.action, "track");
  EXPECT_EQ(seen.frame, "endoscope");
  EXPECT_EQ(seen.q[3], 1.2);
  EXPECT_EQ(seen.features[2], 182);
  EXPECT_EQ(seen.q_covariance[15], 4e-6);
  EXPECT_EQ(seen.error[1], 1);
  EXPECT_EQ(loop.sent<PoseMessage>("pose").size(), 1u);
  EXPECT_EQ(loop.sent<JointMessage>("error").at(0).positions[3], 3);
  EXPECT_EQ(loop.sent<JointMessage>("desired").at(0).names[1], "r_px");
  EXPECT_EQ(loop.transport.sent<DiagnosticMessage>("/diagnostics").at(0).message, "track");
  EXPECT_EQ(loop.sent<CompressedImageMessage>("overlay/compressed").size(), 1u);
}

TEST(LoopTopics, WhatIsNotKnownIsNotANumber) {
  Loop loop;
  ControlTick tick = tick_of(loop.rig);
  tick.seen->observations[0] = {};
  tick.seen->measurement = {};
  tick.decision.control.estimate.reset();
  tick.decision.control.action = ControlAction::hold;
  loop.topics.publish(tick, "hold: marker_lost");
  const ObservationMessage seen = loop.sent<ObservationMessage>("observation").at(0);
  EXPECT_EQ(seen.status, "no_marker");
  for (const double number : {seen.q[0], seen.features[0], seen.error[0], seen.edges_px[7], seen.q_covariance[5]})
    EXPECT_TRUE(std::isnan(number));
  EXPECT_TRUE(loop.sent<PoseMessage>("pose").empty());
  const DiagnosticMessage diagnostic = loop.transport.sent<DiagnosticMessage>("/diagnostics").at(0);
  EXPECT_EQ(diagnostic.message, "hold: marker_lost");
  EXPECT_EQ(diagnostic.level, DiagnosticMessage::Level::warning);
}

// An endoscope that moved has its new place measured by the loop; until then its old one is not said any more.
TEST(LoopTopics, TheRcmIsSaidWhileItIsKnown) {
  Loop loop;
  ControlTick tick = tick_of(loop.rig);
  loop.topics.publish(tick, "");
  tick.decision.registration = 1;
  loop.topics.publish(tick, "hold: endoscope_moved");
  EXPECT_TRUE(loop.transport.sent<StaticTransformsMessage>("/tf_static").empty());
  const auto frames = loop.transport.sent<TransformsMessage>("/tf");
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(frames[0].transforms.at(0).child, "PSM1_rcm");
}

TEST(LoopTopics, HearsCommandsAndDropsWhatMakesNoSense) {
  Loop loop;
  const double begin_s = SteadyClock().now_s();
  loop.transport.say("/lapservo/PSM1/command", StringMessage{0, "start"});
  const LoopWishes both = loop.hear("command", StringMessage{0, "stop"});
  ASSERT_TRUE(both.stops.size() == 1 && both.starts.size() == 1);
  EXPECT_GE(both.starts[0].said_s, begin_s);
  EXPECT_FALSE(both.starts[0].force);
  const LoopWishes forced = loop.hear("command", StringMessage{0, " Start  FORCE\n", 7});
  ASSERT_EQ(forced.starts.size(), 1u);
  EXPECT_TRUE(forced.starts[0].force);
  EXPECT_EQ(forced.starts[0].source, 7u);
  const LoopWishes none = loop.wishes();
  EXPECT_TRUE(none.stops.empty() && none.starts.empty());
  const LoopWishes wishes = loop.hear("set_point", JointMessage{0, names, {0.9, 400, 180, 100}});
  ASSERT_TRUE(wishes.set_point);
  EXPECT_EQ(*wishes.set_point, Eigen::Vector4d(0.9, 400, 180, 100));
  for (const JointMessage& bad : {JointMessage{0, names, {0.9, NAN, 180, 100}}, JointMessage{0, names, {0.9, 400, 180}},
                                  JointMessage{0, {}, {0.9, 400, 180, 100}}}) {
    const LoopWishes dropped = loop.hear("set_point", bad);
    EXPECT_FALSE(dropped.set_point);
    EXPECT_EQ(dropped.remarks.size(), 1u);
  }
}

// A person in a hurry writes what comes to mind.
TEST(LoopTopics, AnyWordButStartStops) {
  Loop loop;
  for (const char* text : {"stop", "STOP", " stop ", "Stop\n"}) {
    const LoopWishes wishes = loop.hear("command", StringMessage{0, text, 3});
    EXPECT_EQ(wishes.stops, std::set<std::uint64_t>{3}) << text;
    EXPECT_TRUE(wishes.remarks.empty()) << text;
  }
  for (const char* text : {"hold", "halt!", "", "starts", "start now", "\x01\xff"}) {
    const LoopWishes wishes = loop.hear("command", StringMessage{0, text, 3});
    EXPECT_EQ(wishes.stops, std::set<std::uint64_t>{3}) << text;
    ASSERT_EQ(wishes.remarks.size(), 1u) << text;
    EXPECT_NE(wishes.remarks.begin()->find("expected start, start force or stop"), std::string::npos);
  }
}

// `ros2 topic pub` repeats once a second; a start that stands would start the arm after each hold.
TEST(LoopTopics, AStartThatIsRepeatedCountsOnce) {
  Loop loop;
  std::size_t starts = 0, remarks = 0;
  for (int k = 0; k < 30; ++k) {
    const LoopWishes wishes = loop.hear("command", StringMessage{0, "start", static_cast<std::uint64_t>(k % 2)});
    starts += wishes.starts.size(), remarks += wishes.remarks.size();
    std::this_thread::sleep_for(std::chrono::milliseconds(60));
  }
  EXPECT_EQ(starts, 1u);
  EXPECT_EQ(remarks, 29u);
  loop.go_on(1.6);
  EXPECT_EQ(loop.hear("command", StringMessage{0, "start"}).starts.size(), 1u);
}

// A goal and a start that are said before and after a stop, which counts in any case. Whether nothing is remarked.
bool expect_to_count(bool counts, Loop& loop, const std::string& start_text, double arm_silent_s,
                     Latched latched = Latched::no) {
  SCOPED_TRACE(start_text);
  JointMessage goal{0, names, {0.9, 400, 180, 100}};
  StringMessage stop{0, "stop"}, start{0, start_text};
  goal.latched = stop.latched = start.latched = latched;
  loop.transport.say("/lapservo/PSM1/set_point", goal);
  loop.transport.say("/lapservo/PSM1/command", stop);
  const LoopWishes wishes = loop.hear("command", start, arm_silent_s);
  EXPECT_EQ(wishes.set_point.has_value(), counts);
  EXPECT_EQ(wishes.starts.size(), counts ? 1u : 0u);
  EXPECT_EQ(wishes.stops.size(), 1u);
  return wishes.remarks.empty();
}

// By a process that was stopped, or by the network.
TEST(LoopTopics, AStartOrAGoalThatMayHaveBeenKeptBackDoesNotCount) {
  Loop loop;
  expect_to_count(true, loop, "start", 0.3);  // as a network that is slow
  expect_to_count(false, loop, "start force", 0.6);
  expect_to_count(false, loop, "start force", 0);
  loop.go_on(1.6);
  expect_to_count(true, loop, "start", 0);
  testing::sleep(0.6);
  expect_to_count(false, loop, "start force", 0);
}

// ROS 1 repeats it for each connection, however old it is.
TEST(LoopTopics, ALatchedStartOrGoalCountsWhereItIsNew) {
  Loop loop;
  EXPECT_FALSE(expect_to_count(false, loop, "start", 0, Latched::perhaps));  // before the loop begins
  EXPECT_FALSE(expect_to_count(false, loop, "start", 0, Latched::perhaps));
  EXPECT_TRUE(expect_to_count(true, loop, "start", 0));
  loop.go_on(1.6);
  EXPECT_TRUE(expect_to_count(true, loop, "start", 0, Latched::perhaps));
  loop.go_on(1.6);
  EXPECT_FALSE(expect_to_count(false, loop, "start", 0, Latched::again));
}

TEST(LoopTopics, KnowsAnotherLoopOfItsName) {
  Loop loop(false);
  loop.topics.publish(tick_of(loop.rig), "");
  EXPECT_FALSE(loop.topics.name_is_in_use());
  loop.hear("desired", JointMessage{});
  EXPECT_TRUE(loop.topics.name_is_in_use());
}

TEST(LoopTopics, HearsNothingWhereNobodyMayCommand) {
  Loop loop(false);
  EXPECT_TRUE(loop.hear("command", StringMessage{0, "start"}).starts.empty());
}

TEST(LoopTopics, HearsTrajectories) {
  Loop loop;
  using Points = std::vector<TrajectoryMessage::Point>;
  const auto refused = [&](const std::vector<std::string>& of, const Points& points) {
    const LoopWishes dropped = loop.hear("trajectory", TrajectoryMessage{0, of, points});
    EXPECT_FALSE(dropped.trajectory);
    EXPECT_EQ(dropped.remarks.size(), 1u);
  };
  loop.transport.say("/lapservo/PSM1/set_point", JointMessage{0, names, {0.8, 390, 170, 90}});
  const Points points{{0, {0.9, 400, 180, 100}}, {2, {0.9, 420, 180, 100}}, {4, {0.9, 400, 180, 100}}};
  const LoopWishes wishes = loop.hear("trajectory", TrajectoryMessage{0, names, points});
  EXPECT_FALSE(wishes.set_point);  // what came last counts
  ASSERT_TRUE(wishes.trajectory);
  EXPECT_EQ(wishes.trajectory->duration_s, 4);
  EXPECT_EQ(wishes.trajectory->at(2).features, Eigen::Vector4d(0.9, 420, 180, 100));
  EXPECT_NEAR(wishes.trajectory->at(2).rate[1], 0, 1e-9);
  EXPECT_EQ(wishes.trajectory->at(9).features, Eigen::Vector4d(0.9, 400, 180, 100));  // it stays at the end

  for (const Points& bad :
       {Points{}, Points{points[0]}, Points{points[1], points[0]}, Points{points[0], {1, {0.9, 400, 180}}},
        Points{points[0], {1, {0.9, NAN, 180, 100}}}, Points{points[0], {NAN, points[1].positions}},
        Points{{-1, points[0].positions}, points[1]}, Points{points[0], {3601, points[1].positions}}})
    refused(names, bad);
  refused({"r_px", "s_rad", "l_px", "d_px"}, points);
}

TEST(LoopTopics, HearsGoalsOfTheTip) {
  Loop loop;
  const auto say = [&](const Eigen::Vector3d& place_m, const Eigen::Quaterniond& turn, const std::string& frame = {}) {
    return loop.hear("tip_goal", PlaceMessage{0, frame, {turn, place_m}});
  };
  const Eigen::Vector3d place_m(0.01, -0.02, 0.12);
  const Eigen::Quaterniond unset(1, 0, 0, 0), turned(0.6, 0, 0.8, 0);
  const LoopWishes given = say(place_m, turned);
  ASSERT_TRUE(given.tip_goal);
  for (const Eigen::Quaterniond& nobodys : {unset, Eigen::Quaterniond(0, 0, 0, 0)}) {
    const LoopWishes free = say(place_m, nobodys);
    ASSERT_TRUE(free.tip_goal);
    EXPECT_EQ(free.tip_goal->position_m, place_m);
    EXPECT_FALSE(free.tip_goal->camera_from_tip);
  }
  EXPECT_TRUE(given.tip_goal->camera_from_tip->isApprox(turned));
  for (const auto& [bad_m, turn, why] : {std::tuple{Eigen::Vector3d(NAN, 0, 0.1), unset, "a finite number"},
                                         std::tuple{Eigen::Vector3d(10, -20, 120), unset, "looks like millimetres"},
                                         std::tuple{place_m, Eigen::Quaterniond(0, 0, 0, 0.5), "a unit quaternion"},
                                         std::tuple{place_m, Eigen::Quaterniond(NAN, 0, 0, 0), "a unit quaternion"}}) {
    const LoopWishes none = say(bad_m, turn);
    EXPECT_FALSE(none.tip_goal);
    ASSERT_EQ(none.remarks.size(), 1u);
    EXPECT_NE(none.remarks.begin()->find(why), std::string::npos) << *none.remarks.begin();
  }

  const TrajectoryMessage plan{0, {"x_m", "y_m", "z_m"}, {{0, {0, 0, 0.1}}, {2, {0.01, 0, 0.1}}}};
  for (const std::string frame : {"", "endoscope", "/endoscope", "camera", "PSM1_rcm", "/", "//endoscope"}) {
    TrajectoryMessage planned = plan;
    planned.frame = frame;
    const LoopWishes place = say(place_m, unset, frame), path = loop.hear("trajectory", planned);
    const bool counts = frame.empty() || frame == "endoscope" || frame == "/endoscope";
    EXPECT_EQ(place.tip_goal.has_value(), counts) << frame;
    EXPECT_EQ(path.trajectory.has_value(), counts) << frame;
    for (const auto& remarks : {place.remarks, path.remarks})
      EXPECT_NE(counts, std::any_of(remarks.begin(), remarks.end(), [&](const std::string& remark) {
                  return remark.find("header.frame_id: is " + frame + ", expected endoscope") != std::string::npos;
                }));
  }
  TrajectoryMessage of_features{0, names, {{0, {0.9, 400, 180, 100}}, {2, {0.9, 420, 180, 100}}}};
  of_features.frame = "camera";  // means nothing to them
  EXPECT_TRUE(loop.hear("trajectory", of_features).trajectory);
  loop.transport.say("/lapservo/PSM1/tip_goal", PlaceMessage{0, {}, {unset, place_m}});
  const LoopWishes last = loop.hear("trajectory", plan);
  EXPECT_FALSE(last.tip_goal);  // what came last counts
  ASSERT_TRUE(last.trajectory && last.trajectory->tip_at(2));
  EXPECT_EQ(last.trajectory->tip_at(2)->position_m, Eigen::Vector3d(0.01, 0, 0.1));
}

}  // namespace lapservo::internal::loop_topics_test
