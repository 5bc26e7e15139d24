#include "recordings/open_bag.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_messages.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/test_bags.h"
#include "transports/ros2/cdr.h"

namespace lapservo::internal::open_bag_test {
using testing::BagEntry;
using testing::input_error;

constexpr double begin_s = 1700000000;

JointMessage joints_at(int i) {
  return {begin_s + 0.25 * i, {"yaw", "pitch"}, {0.5 * i, -1.5}};
}
ImageMessage image_at(int i) {
  return {begin_s + 0.5 * i, 2, 1, 6, "rgb8", false, {1, 2, 3, 4, 5, static_cast<std::uint8_t>(i)}};
}

// Four readings of joints, two images and a compressed one, in `bytes`' format.
template <typename Bytes>
std::vector<BagEntry> entries(const Bytes& bytes) {
  std::vector<BagEntry> all;
  for (int i = 0; i < 4; ++i) {
    const double time_s = begin_s + 0.25 * i;
    all.push_back({"/PSM1/measured_js", joint_type, time_s, bytes(joints_at(i))});
    if (i % 2 == 0) all.push_back({"/image", image_type, time_s, bytes(image_at(i / 2))});
  }
  all.push_back(
      {"/image/compressed", compressed_image_type, begin_s, bytes(CompressedImageMessage{begin_s, "png", {7}})});
  all.push_back({"/other", "std_msgs/String", begin_s, {1, 2, 3}});
  return all;
}
const auto as_ros1 = [](const auto& message) { return testing::ros1_bytes(message); };
const auto as_ros2 = [](const auto& message) { return testing::cdr_bytes(message); };

template <typename Message>
std::vector<Message> all(const Bag& bag, const std::string& name) {
  const auto topic = std::ranges::find(bag.topics(), name, &BagTopic::name);
  std::vector<Message> messages;
  if (topic == bag.topics().end()) return messages;
  const auto from = bag.messages(*topic);
  while (auto message = from->next()) messages.push_back(std::get<Message>(std::move(*message)));
  EXPECT_FALSE(from->next());  // it stays at the end
  return messages;
}

void expect_entries(const Bag& bag) {
  std::vector<std::string> listed;
  for (const BagTopic& topic : bag.topics())
    listed.push_back(topic.name + " " + topic.type + " " + std::to_string(topic.messages));
  EXPECT_EQ(listed,
            (std::vector<std::string>{"/PSM1/measured_js sensor_msgs/JointState 4", "/image sensor_msgs/Image 2",
                                      "/image/compressed sensor_msgs/CompressedImage 1", "/other std_msgs/String 1"}));
  const auto joints = all<JointMessage>(bag, "/PSM1/measured_js");
  ASSERT_EQ(joints.size(), 4u);
  for (int i = 0; i < 4; ++i) expect_same(joints[static_cast<std::size_t>(i)], joints_at(i));
  const auto images = all<ImageMessage>(bag, "/image");
  ASSERT_EQ(images.size(), 2u);
  expect_same(images[1], image_at(1));
  EXPECT_EQ(all<CompressedImageMessage>(bag, "/image/compressed").at(0).format, "png");
}

TEST(OpenBag, ReadsWhatRosbagWrites) {
  const testing::TemporaryFolder folder;
  for (const char* compression : {"none", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    const std::string path = folder / (std::string(compression) + ".bag");
    testing::write_ros1_bag(path, entries(as_ros1), compression);
    ASSERT_TRUE(is_bag(path));
    expect_entries(*open_bag(path));
  }
  // Split, and named so that the alphabet's order is not theirs.
  const auto messages = entries(as_ros1);
  const std::filesystem::path split = folder / "split";
  std::filesystem::create_directory(split);
  testing::write_ros1_bag(split / "run_9.bag", {messages.begin(), messages.begin() + 3});
  testing::write_ros1_bag(split / "run_10.bag", {messages.begin() + 3, messages.end()});
  ASSERT_TRUE(is_bag(split));
  EXPECT_EQ(open_bag(split)->remark(), "its 2 bags are read as one, in the order of their times");
  EXPECT_EQ(all<JointMessage>(*open_bag(split), "/PSM1/measured_js").at(3).stamp_s, joints_at(3).stamp_s);
  EXPECT_EQ(all<ImageMessage>(*open_bag(split), "/image").at(1).data, image_at(1).data);
  testing::write_file(split / "0000.png", "\x89PNG");
  EXPECT_FALSE(is_bag(split));
}

TEST(OpenBag, ReadsRos2sFilesAndFolders) {
  const testing::TemporaryFolder folder;
  auto messages = entries(as_ros2);
  const std::string whole = folder / "whole.db3";
  testing::write_ros2_bag(whole, messages);
  ASSERT_TRUE(is_bag(whole));
  expect_entries(*open_bag(whole));
  EXPECT_FALSE(std::filesystem::exists(whole + "-shm")) << "reading leaves something behind";

  // Split, and named so that the alphabet's order is not theirs.
  const std::filesystem::path split = folder / "split";
  std::filesystem::create_directory(split);
  testing::write_ros2_bag(split / "bag_9.db3", {messages.begin(), messages.begin() + 3});
  testing::write_ros2_bag(split / "bag_10.db3", {messages.begin() + 3, messages.end()});
  testing::write_file(split / "bag_11.db3", "");  // just begun
  expect_entries(*open_bag(split));
  EXPECT_EQ(open_bag(split)->remark(), "has no metadata.yaml: the times of its files decide their order");
  testing::write_ros2_metadata(split, {"bag_9.db3", "split/bag_10.db3"});
  ASSERT_TRUE(is_bag(split));
  expect_entries(*open_bag(split));
  std::filesystem::remove(split / "metadata.yaml");
  testing::write_mcap(split / "bag_12.mcap", messages);
  EXPECT_NE(input_error([&] { open_bag(split); }).find("files of several kinds"), std::string::npos);
}

TEST(OpenBag, SaysWhichFilesOfAFolderItsMetadataDoesNotList) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"bag_0.db3", "bag_1.db3", "bag_2.db3"})
    testing::write_ros2_bag(folder / name, entries(as_ros2));
  testing::write_file(folder / "bag_3.db3.zstd", "packed");
  testing::write_file(folder / "bag_0.db3-wal", "");
  testing::write_ros2_metadata(folder.path(), {"bag_0.db3"});
  EXPECT_EQ(open_bag(folder.path())->remark(),
            "metadata.yaml does not list bag_1.db3, bag_2.db3, bag_3.db3.zstd: not read; `ros2 bag reindex` lists all "
            "files");
  EXPECT_EQ(open_bag(folder / "bag_1.db3")->remark(), "");
  testing::write_ros2_metadata(folder.path(), {"bag_0.db3", "bag_1.db3", "bag_0.db3"});
  const std::string twice = input_error([&] { open_bag(folder.path()); });
  EXPECT_NE(twice.find("metadata.yaml: relative_file_paths: is bag_0.db3, expected each file once"), std::string::npos);
}

TEST(OpenBag, RefusesInOneLineWhatItCannotRead) {
  const testing::TemporaryFolder folder;
  const auto refusal = [&](const std::filesystem::path& path) {
    EXPECT_TRUE(is_bag(path)) << path;
    const std::string text = input_error([&] { open_bag(path); });
    EXPECT_EQ(text.rfind(path.string(), 0), 0u) << text;
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    return text;
  };
  const auto file = [&](const char* name, const std::string& content) {
    testing::write_file(folder / name, content);
    return folder / name;
  };
  const auto expect = [](const std::string& text, const char* words) {
    EXPECT_NE(text.find(words), std::string::npos) << text;
  };
  testing::write_ros1_bag(folder / "whole.bag", entries(as_ros1));
  std::string bag = testing::read_file(folder / "whole.bag");
  expect(refusal(file("cut.bag", bag.substr(0, bag.size() - 100))), "is cut short");
  std::string unindexed = bag;
  unindexed.replace(unindexed.find("index_pos=") + 10, 8, 8, '\0');
  expect(refusal(file("active.bag", unindexed)),
         "has no index, expected a whole ROS 1 bag: copy it again, or try `rosbag");
  expect(refusal(file("empty.bag", "")), "is empty");
  expect(refusal(file("old.bag", "#ROSBAG V1.2\n...")), "rosbag fix");
  expect(refusal(file("foreign.bag", "a text")), "is no ROS 1 bag");

  testing::write_ros2_bag(folder / "whole.db3", entries(as_ros2));
  const std::string db3 = testing::read_file(folder / "whole.db3");
  expect(refusal(file("cut.db3", db3.substr(0, db3.size() / 2))), "can't be read as a ROS 2 bag");
  std::string logged = db3;
  logged[18] = logged[19] = 2;  // by a log, whose index has no place
  file("logged.db3-wal", "a log"), std::filesystem::create_symlink("none/none", folder / "logged.db3-shm");
  expect(refusal(file("logged.db3", logged)), "copy the folder to where it can be");
  expect(refusal(file("empty.db3", "")), "is empty");
  expect(refusal(file("foreign.db3", "a text that is no database")), "can't be read as a ROS 2 bag");
  expect(refusal(file("packed.db3.zstd", "\x28\xb5\x2f\xfd")), "zstd -d");
  expect(refusal(file("short.mcap", "\x89MCAP0")), "is no MCAP recording");
  expect(refusal(file("foreign.mcap", "a text that is no recording")), "is no MCAP recording");
  expect(refusal(file("empty.mcap", "")), "is empty");

  const std::filesystem::path split = folder / "split";
  std::filesystem::create_directory(split);
  testing::write_ros2_bag(split / "bag_0.db3", entries(as_ros2));
  const auto with_metadata = [&](auto... arguments) {
    testing::write_ros2_metadata(split, arguments...);
    return refusal(split);
  };
  using Files = std::vector<std::string>;
  expect(with_metadata(Files{"bag_0.db3"}, "tape"), "storage_identifier: is tape");
  expect(with_metadata(Files{"bag_0.db3.zstd"}, "sqlite3", "zstd"), "compression_format: is zstd");
  expect(with_metadata(Files{"bag_0.db3", "bag_1.db3"}), "bag_1.db3: does not exist");
  expect(with_metadata(Files{}), "names no files");
  testing::write_file(split / "metadata.yaml", "[");
  expect(refusal(split), "expected a ROS 2 bag's YAML");

  EXPECT_FALSE(is_bag(file("picture.png", "\x89PNG")));
  EXPECT_FALSE(is_bag(folder / "missing.bag"));
}

TEST(CdrDecoder, ReadsBothByteOrdersAndNothingThatIsCutShort) {
  const JointMessage joints{begin_s + 0.5, {"yaw", "", "pitch"}, {0.25, -1.5, 3}};
  for (const bool big_endian : {false, true}) {
    const auto bytes = testing::cdr_bytes(joints, big_endian);
    const auto read = decode_cdr<JointMessage>(bytes);
    ASSERT_TRUE(read);
    expect_same(*read, joints);
    const auto image = decode_cdr<ImageMessage>(testing::cdr_bytes(image_at(3), big_endian));
    ASSERT_TRUE(image);
    expect_same(*image, image_at(3));
    for (std::size_t size = 0; size < bytes.size(); ++size)
      EXPECT_FALSE(decode_cdr<JointMessage>(std::span(bytes).first(size))) << size;
    auto longer = bytes;
    longer.resize(bytes.size() + 8);
    EXPECT_TRUE(decode_cdr<JointMessage>(longer));  // filled up
    longer.resize(bytes.size() + 9);
    EXPECT_FALSE(decode_cdr<JointMessage>(longer));
  }
}

}  // namespace lapservo::internal::open_bag_test
