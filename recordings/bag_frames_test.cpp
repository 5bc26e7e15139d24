#include "recordings/bag_frames.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/bag_endoscope.h"
#include "recordings/bag_joints.h"
#include "recordings/bag_topics.h"
#include "recordings/open_bag.h"
#include "recordings/test_bags.h"

namespace lapservo::internal::bag_frames_test {
using testing::BagEntry;
using testing::input_error;

ImageMessage image_at(double stamp_s, const std::string& encoding = "bgr8") {
  return {stamp_s, 2, 1, 6, encoding, false, {1, 2, 3, 4, 5, 6}};
}

class BagOfImages {
 public:
  explicit BagOfImages(const std::vector<ImageMessage>& images) {
    std::vector<BagEntry> entries;
    for (const ImageMessage& image : images)
      entries.push_back(
          {"/image", image_type, 50 + 0.1 * static_cast<double>(entries.size()), testing::cdr_bytes(image)});
    testing::write_ros2_bag(folder_ / "run.db3", entries);
  }
  std::unique_ptr<BagFrames> open(const std::string& topic = "") const {
    return std::make_unique<BagFrames>(open_bag(folder_ / "run.db3"), topic);
  }

 private:
  testing::TemporaryFolder folder_;
};

TEST(BagFrames, HaveTheTimesOfTheirStamps) {
  const BagOfImages bag({image_at(100), image_at(100.04), image_at(100.2)});
  const auto frames = bag.open();
  EXPECT_EQ(frames->frame_count(), 3);
  EXPECT_NEAR(frames->frames_per_second(), 10, 1e-6);
  std::vector<double> times_s;
  while (const auto frame = frames->next()) {
    EXPECT_EQ(frame->index, static_cast<int>(times_s.size()));
    EXPECT_EQ(frame->bgr.at<cv::Vec3b>(0, 1), cv::Vec3b(4, 5, 6));
    times_s.push_back(frame->time_s);
  }
  ASSERT_EQ(times_s.size(), 3u);
  EXPECT_NEAR(times_s[1], 0.04, 1e-6);
  EXPECT_NEAR(times_s[2], 0.2, 1e-6);
  EXPECT_EQ(frames->first_stamp_s(), 100);
  EXPECT_EQ(frames->complaint(), "");
}

TEST(BagFrames, LeaveOutWhatIsNoFrameAndSayIt) {
  ImageMessage short_of_pixels = image_at(101);
  short_of_pixels.data.pop_back();
  const BagOfImages bag({image_at(0), image_at(100), image_at(100), image_at(99), short_of_pixels, image_at(102)});
  const auto frames = bag.open();
  while (frames->next()) continue;
  EXPECT_EQ(frames->complaint(), "/image: 4 of 6 images are left out (no stamp)");
}

TEST(BagFrames, WithoutAnyThatCanBeReadAreRefused) {
  const BagOfImages bag({image_at(100, "mono8"), image_at(101, "mono8")});
  const std::string error = input_error([&] { bag.open(); });
  EXPECT_NE(error.find("/image: none of 2 images can be read: "), std::string::npos) << error;
  EXPECT_NE(error.find("mono8"), std::string::npos) << error;
}

class BagOfJoints {
 public:
  explicit BagOfJoints(const std::vector<JointMessage>& readings) {
    std::vector<BagEntry> entries;
    for (const JointMessage& reading : readings)
      entries.push_back({"/PSM1/measured_js", joint_type, 50 + 0.02 * static_cast<double>(entries.size()),
                         testing::ros1_bytes(reading)});
    testing::write_ros1_bag(folder_ / "run.bag", entries);
    bag_ = open_bag(folder_ / "run.bag");
  }
  JointRecording read() const { return joints_in_bag(*bag_, topic(), Joints{{"b", "a", "d", "c"}, {}, {}}, 99); }
  std::vector<std::string> names() const { return joint_names_in_bag(*bag_, topic()); }

 private:
  const BagTopic& topic() const { return *joint_topic_of(*bag_, "", "PSM1"); }

  testing::TemporaryFolder folder_;
  std::shared_ptr<const Bag> bag_;
};

// By noise it does not.
TEST(BagEndoscope, SaysByHowMuchAndWhenItMoved) {
  const testing::TemporaryFolder folder;
  const auto text_of = [&](double way_m) {
    std::vector<BagEntry> entries;
    for (int i = 0; i < 300; ++i) {
      PlaceMessage place{100 + 0.01 * i, "Cart", {}};
      const double x_m = way_m * std::clamp(0.01 * i - 1, 0.0, 1.0) + 2e-5 * std::sin(9.0 * i);
      place.pose = {Eigen::Quaterniond(Eigen::AngleAxisd(5 * x_m, Eigen::Vector3d::UnitY())), {x_m, 0, 0}};
      entries.push_back({"/ECM/measured_cp", place_type, place.stamp_s, testing::ros1_bytes(place)});
    }
    testing::write_ros1_bag(folder / "run.bag", entries);
    return endoscope_motion_text(*open_bag(folder / "run.bag"));
  };
  EXPECT_EQ(text_of(0), "");
  EXPECT_EQ(text_of(3e-3), "the endoscope moved by 3.0 mm and 15.1 mrad between 1.1 and 1.9 s");
}

// Those of another arm on the same topic are passed over.
TEST(BagJoints, AreThoseOfTheRigInItsOrder) {
  const std::vector<std::string> names{"a", "b", "c", "d", "wrist"}, others{"e", "f", "g", "h"};
  const BagOfJoints bag({{0, {}, {}},  // of an arm that is not homed
                         {100, names, {1, 2, 3, 0.4, 5}},
                         {100, names, {9, 9, 9, 9, 9}},  // the same stamp again
                         {100.1, others, {9, 9, 9, 9}},
                         {100.2, others, {9, 9, 9, 9}},
                         {100.5, names, {NAN, 2, 3, 0.4, 5}},
                         {0, names, {9, 9, 9, 9, 9}},
                         {101, names, {1.5, 2, 3, 0.4, 5}}});
  const JointRecording recording = bag.read();
  EXPECT_EQ(recording.time_s, (std::vector<double>{1, 2}));
  EXPECT_EQ(recording.joints[1], (std::array<double, 4>{2, 1.5, 0.4, 3}));
  EXPECT_EQ(recording.of_other_arms, 2);
  EXPECT_EQ(bag.names(), names);
}

TEST(BagJoints, ThatArePassedOverAreCountedAndSaid) {
  const std::vector<std::string> names{"a", "b", "c", "d"};
  std::vector<JointMessage> readings;
  for (int i = 0; i < 40; ++i)
    readings.push_back({100 + 0.02 * i + (i == 7 ? 3600 : 0), names, {1, 2, i == 9 ? NAN : 3, 0.4}});
  const JointRecording ahead = BagOfJoints(readings).read();
  EXPECT_EQ(ahead.time_s.size(), 38U);
  EXPECT_EQ(ahead.remark(),
            "passed over: 1 readings without a stamp that goes with the others', 1 readings that are no numbers");
  for (int i = 20; i < 40; ++i) readings[static_cast<std::size_t>(i)].stamp_s -= 50;
  const JointRecording set_back = BagOfJoints(readings).read();
  EXPECT_EQ(set_back.time_s.size(), 38U);
  EXPECT_TRUE(set_back.remark().ends_with("; the clock of the joints was set 1 times: times go on by the recorder's"));
  EXPECT_TRUE(
      clock_set_text("/image", 2, 1).ends_with(", 1 times by the usual gap: the recorder's shows no later time"));
}

TEST(BagJoints, ThatCanNotBeUsedAreRefused) {
  constexpr double since_1970_s = 1.7e9;
  const std::vector<std::string> names{"a", "b", "c", "d"};
  const std::vector<std::pair<std::vector<JointMessage>, std::string>> cases{
      {{{since_1970_s, names, {1, 2, 3, 0.4}}, {since_1970_s + 1, names, {1, 2, 3, 0.4}}},
       "the images are stamped by the time since a computer's start"},
      {{{100, {"a", "b", "c"}, {1, 2, 3}}},
       "/PSM1/measured_js: has no positions of the rig's joints: it has the joints a, b, c, expected b, a, d, c"},
      {{{100, names, {1, 2, 3, 0.4}}, {101, {"a", "b", "c", "d", "b"}, {1, 2, 3, 0.4, 5}}},
       "/PSM1/measured_js: names the joint b twice in a message, expected each name once"},
      {{{100, names, {1, 2, 3}}}, "has no positions of the rig's joints"},
      {{{100, names, {1, 2, 3, 0.4}}}, "has 1 readings"}};
  for (const auto& [readings, said] : cases) {
    const std::string error = input_error([&bag = readings] { BagOfJoints(bag).read(); });
    EXPECT_NE(error.find(said), std::string::npos) << error;
  }
}

TEST(BagJoints, OfTwoArmsOnOneTopicAreRefused) {
  std::vector<JointMessage> readings;
  for (const double other : {0.0, 0.02}) {
    readings.clear();
    for (int i = 0; i < 100; ++i) {
      const double b = 0.3 * std::sin(0.05 * i) + i % 2 * other;
      readings.push_back({100 + 0.01 * i, {"a", "b", "c", "d"}, {b, 0.1, 0.1, 0.05}});
    }
    const std::string error = input_error([&] { BagOfJoints(readings).read(); });
    EXPECT_EQ(error.find("two arms publish there") != std::string::npos, other > 0) << error;
  }
}

}  // namespace lapservo::internal::bag_frames_test
