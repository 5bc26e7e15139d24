#include <algorithm>
#include <filesystem>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/ros2_file.h"
#include "recordings/test_bags.h"

namespace lapservo::internal::mcap_file_test {
using namespace testing;

constexpr double begin_s = 1700000000;

// Messages of two topics in turn, all different; every fifth so long.
std::vector<BagEntry> entries(int count, std::size_t longest = 40) {
  std::vector<BagEntry> all;
  for (int i = 0; i < count; ++i) {
    const std::string text = "message " + std::to_string(i) + " of " + std::to_string(count) + ".";
    std::vector<std::uint8_t> bytes(text.begin(), text.end());
    if (i % 5 == 3) bytes.resize(longest, static_cast<std::uint8_t>(i));
    all.push_back({i % 2 == 0 ? "/even" : "/odd", "std_msgs/String", begin_s + 0.125 * i, std::move(bytes)});
  }
  return all;
}

struct Raw {
  std::uint64_t time_ns = 0;
  std::vector<std::uint8_t> bytes;
  bool operator==(const Raw&) const = default;
};

std::vector<Raw> read_all(const Ros2File& file, const std::string& topic) {
  std::vector<Raw> all;
  const auto from = file.messages(topic, "std_msgs/msg/String");
  while (const auto raw = from()) all.push_back({raw->recorded_ns, {raw->bytes.begin(), raw->bytes.end()}});
  EXPECT_FALSE(from());
  return all;
}

std::vector<Raw> expected(const std::vector<BagEntry>& entries, const std::string& topic) {
  std::vector<Raw> all;
  for (const BagEntry& entry : entries)
    if (entry.topic == topic)
      all.push_back({static_cast<std::uint64_t>(std::llround(1e9 * entry.time_s)), entry.bytes});
  return all;
}

void expect_entries(const Ros2File& file, const std::vector<BagEntry>& entries) {
  std::size_t counted = 0;
  for (const Ros2FileTopic& topic : file.topics()) {
    const auto messages = expected(entries, topic.name);
    EXPECT_EQ(topic.type, "std_msgs/msg/String");
    EXPECT_EQ(topic.format, "cdr");
    EXPECT_EQ(topic.messages, messages.size());
    EXPECT_LE(topic.first_ns, messages.front().time_ns);
    EXPECT_GE(topic.last_ns, messages.back().time_ns);
    EXPECT_TRUE(read_all(file, topic.name) == messages);
    counted += messages.size();
  }
  EXPECT_EQ(counted, entries.size());
}

std::vector<McapLayout> layouts() {
  std::vector<McapLayout> all;
  for (const char* compression : {"", "lz4", "zstd"})
    for (const std::size_t messages : {0u, 2u, 100u})
      for (const bool with_summary : {false, true})
        if (messages > 0 || *compression == '\0')
          all.push_back({compression, messages, with_summary, (messages + with_summary) % 2 == 0});
  return all;
}
std::string name_of(const McapLayout& layout) {
  return layout.compression + " " + std::to_string(layout.messages_a_chunk) + (layout.with_summary ? " summary" : "");
}

TEST(McapFile, IsReadInEveryLayout) {
  const testing::TemporaryFolder folder;
  for (const McapLayout& layout : layouts()) {
    SCOPED_TRACE(name_of(layout));
    testing::write_mcap(folder / "a.mcap", entries(11, 40000), layout);
    const auto file = open_mcap_file(folder / "a.mcap");
    expect_entries(*file, entries(11, 40000));
    EXPECT_EQ(file->remark(), "");
  }
}

TEST(McapFile, ThatWasCutGivesItsWholeMessages) {
  const testing::TemporaryFolder folder;
  const auto messages = entries(3);
  const std::string path = folder / "a.mcap";
  for (const McapLayout& layout : layouts()) {
    SCOPED_TRACE(name_of(layout));
    testing::write_mcap(path, messages, layout);
    const std::string whole = testing::read_file(path);
    std::vector<std::size_t> ends;  // of the messages, where they stand in the file as they are
    for (const BagEntry& entry : messages)
      ends.push_back(whole.find(std::string(entry.bytes.begin(), entry.bytes.end())) + entry.bytes.size());
    std::size_t last = messages.size();
    for (std::size_t size = whole.size() - 8; size >= 8; --size) {
      std::filesystem::resize_file(path, size);
      const auto file = open_mcap_file(path);
      std::size_t count = 0;
      for (const Ros2FileTopic& topic : file->topics()) {
        const auto found = read_all(*file, topic.name), all = expected(messages, topic.name);
        ASSERT_LE(found.size(), all.size());
        EXPECT_TRUE(std::equal(found.begin(), found.end(), all.begin()));
        EXPECT_EQ(topic.messages, found.size());
        count += found.size();
      }
      if (layout.compression.empty()) {
        ASSERT_EQ(count, static_cast<std::size_t>(
                             std::count_if(ends.begin(), ends.end(), [size](std::size_t end) { return end <= size; })))
            << size;
      }
      ASSERT_LE(count, last);
      ASSERT_TRUE(size + 8 < whole.size() || count == messages.size());
      last = count;
      EXPECT_EQ(file->remark().empty(),
                whole.substr(0, size).find(std::string("\x0f\4\0\0\0\0\0\0\0\0\0\0\0", 13)) != std::string::npos);
    }
    EXPECT_EQ(last, 0u);
  }
}

TEST(McapFile, WithAnIndexIsReadByTheTimesOfItsMessages) {
  const testing::TemporaryFolder folder;
  auto messages = entries(24);
  std::mt19937 random(59);
  for (int i = 0; i < 20; ++i) {
    std::shuffle(messages.begin(), messages.end(), random);
    const auto of_chunk = 1 + static_cast<std::size_t>(i) % 7, loose_every = i % 3 == 0 ? 0U : of_chunk % 2 + 2;
    testing::write_mcap(folder / "a.mcap", messages, {"", of_chunk, true, true, loose_every});
    expect_entries(*open_mcap_file(folder / "a.mcap"), entries(24));
  }
}

TEST(McapFile, ChecksTheSumsThatItHas) {
  const testing::TemporaryFolder folder;
  const std::string path = folder / "a.mcap";
  for (const bool with_checksums : {true, false}) {
    testing::write_mcap(path, entries(6), {"", 3, true, with_checksums});
    const std::string whole = testing::read_file(path);
    std::string damaged = whole;
    damaged[whole.find("message 1 of")] ^= 1;
    testing::write_file(path, damaged);
    const std::string error = input_error([&] { read_all(*open_mcap_file(path), "/odd"); });
    EXPECT_EQ(error.find("is damaged at byte") != std::string::npos, with_checksums) << error;

    // A summary that is damaged is not used: the messages are all there.
    damaged = whole;
    damaged[whole.rfind("/even")] ^= 1;
    testing::write_file(path, damaged);
    EXPECT_EQ(open_mcap_file(path)->topics().front().name == "/even", with_checksums);
  }
}

}  // namespace lapservo::internal::mcap_file_test
