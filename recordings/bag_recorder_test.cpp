#include "recordings/bag_recorder.h"

#include <limits>
#include <map>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_messages.h"
#include "lapservo/testing/fast_cdr.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/open_bag.h"
#include "recordings/ros2_bag_writer.h"
#include "transports/ros2/cdr.h"

namespace lapservo::internal::bag_recorder_test {
using eprosima::fastcdr::Cdr;
using lapservo::testing::input_error;

constexpr double begin_s = 1700000000;

JointMessage joints_at(double time_s) {
  return {time_s, {"yaw", "pitch", "insertion"}, {0.5, -1.5, time_s - begin_s}};
}
ImageMessage image_at(double time_s) {
  return {time_s, 2, 1, 6, "rgb8", false, {1, 2, 3, 4, 5, 6}};
}

std::vector<BagMessage> all(const Bag& bag, const std::string& name) {
  std::vector<BagMessage> messages;
  for (const BagTopic& topic : bag.topics())
    if (topic.name == name)
      for (const auto from = bag.messages(topic); auto message = from->next();) messages.push_back(std::move(*message));
  return messages;
}

TEST(CdrEncoder, IsReadByFastCdr) {
  std::vector<std::uint8_t> bytes = encode_cdr(joints_at(begin_s + 0.25));
  eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(bytes.data()), bytes.size());
  Cdr cdr(buffer, Cdr::LITTLE_ENDIANNESS, lapservo::testing::ros2_cdr);
  cdr.read_encapsulation();
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
  std::string frame = "?";
  std::vector<std::string> names;
  std::vector<double> positions, velocities{1}, efforts{1};
  cdr >> sec >> nanosec >> frame >> names >> positions >> velocities >> efforts;
  EXPECT_EQ(sec, 1700000000);
  EXPECT_EQ(nanosec, 250000000u);
  EXPECT_EQ(frame, "");
  EXPECT_EQ(names, joints_at(0).names);
  EXPECT_EQ(positions, (std::vector<double>{0.5, -1.5, 0.25}));
  EXPECT_TRUE(velocities.empty() && efforts.empty());
  EXPECT_EQ(lapservo::testing::bytes_of(cdr), bytes.size());
  const auto rounded = encode_cdr(joints_at(2 - 1e-10));  // up to the next second
  EXPECT_EQ((std::vector<std::uint8_t>(rounded.begin() + 4, rounded.begin() + 12)),
            (std::vector<std::uint8_t>{2, 0, 0, 0, 0, 0, 0, 0}));
}

// A bag that was never finished keeps its messages.
TEST(Ros2BagWriter, WritesWhatIsReadAgain) {
  const CompressedImageMessage jpeg{begin_s, "jpeg", {7, 8}};
  for (const bool is_finished : {true, false}) {
    const lapservo::testing::TemporaryFolder folder;
    {
      Ros2BagWriter writer(folder / "bag");
      for (int i = 0; i < 5; ++i) writer.write("/PSM1/measured_js", begin_s + i, joints_at(begin_s + i));
      writer.write("/image", begin_s + 1, image_at(begin_s + 0.5));
      writer.write("/image/compressed", begin_s + 2, jpeg);
      if (is_finished) writer.finish();
    }
    const auto bag = open_bag((folder / (is_finished ? "bag" : "bag/bag_0.mcap")).string());
    ASSERT_EQ(bag->topics().size(), 3u);
    const auto joints = all(*bag, "/PSM1/measured_js");
    ASSERT_EQ(joints.size(), 5u);
    expect_same(std::get<JointMessage>(joints[4]), joints_at(begin_s + 4));
    expect_same(std::get<ImageMessage>(all(*bag, "/image").at(0)), image_at(begin_s + 0.5));
    expect_same(std::get<CompressedImageMessage>(all(*bag, "/image/compressed").at(0)), jpeg);
    EXPECT_TRUE(!is_finished || bag->remark().empty()) << bag->remark();
  }
}

TEST(BagRecorder, NeverGoesOverSomethingAndLeavesNothingOfNothing) {
  const lapservo::testing::TemporaryFolder folder;
  lapservo::testing::write_file(folder / "mine.txt", "mine");
  const std::string path = folder.path().string();
  EXPECT_EQ(input_error([&] { Ros2BagWriter{path}; }), path + ": exists, expected the name of a new folder");
  EXPECT_TRUE(std::filesystem::exists(folder / "mine.txt"));
  { const BagRecorder ended_early(folder / "bag"); }
  EXPECT_FALSE(std::filesystem::exists(folder / "bag"));
  BagRecorder(folder / "bag").finish();
}

TEST(BagRecorder, RecordsFromSeveralThreadsTheFirstSenderOfATopic) {
  const lapservo::testing::TemporaryFolder folder;
  constexpr int count = 200;
  BagRecorder recorder(folder / "bag");
  std::thread arm([&] {
    for (int i = 0; i < count; ++i) recorder.add("/PSM1/measured_js", joints_at(begin_s + i));
  });
  for (int i = 0; i < count; ++i) recorder.add("/image", image_at(begin_s + i));
  arm.join();
  recorder.add("/image", image_at(std::numeric_limits<double>::quiet_NaN()));
  recorder.add("/image", image_at(0));
  JointMessage of_another = joints_at(begin_s + count);
  of_another.source = 1;
  recorder.add("/PSM1/measured_js", joints_at(begin_s + count));
  recorder.add("/PSM1/measured_js", of_another);
  recorder.finish();
  EXPECT_EQ(recorder.counts().of_second_senders, (std::map<std::string, long>{{"/PSM1/measured_js", 1}}));
  EXPECT_EQ(recorder.counts().images, count);
  EXPECT_EQ(recorder.counts().arrived, count);
  EXPECT_EQ(recorder.counts().joints, count + 1);
  EXPECT_EQ(recorder.counts().unstamped, 2);
  const auto bag = open_bag((folder / "bag").string());
  EXPECT_EQ(all(*bag, "/PSM1/measured_js").size(), static_cast<std::size_t>(count + 1));
  const auto images = all(*bag, "/image");
  ASSERT_EQ(images.size(), static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) EXPECT_EQ(std::get<ImageMessage>(images[i]).stamp_s, begin_s + i);
}

}  // namespace lapservo::internal::bag_recorder_test
