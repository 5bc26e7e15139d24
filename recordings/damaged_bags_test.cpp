// Whatever befell a bag's bytes, it is read or refused: no crash, no endless loop, no more messages than there can be.

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/testing/temporary_folder.h"
#include "recordings/open_bag.h"
#include "recordings/test_bags.h"

namespace lapservo::internal {
namespace {
using testing::BagEntry;

std::vector<BagEntry> entries(bool ros2) {
  std::vector<BagEntry> all;
  for (int i = 0; i < 40; ++i) {
    const double time_s = 100 + 0.1 * i;
    const JointMessage joints{time_s, {"yaw", "pitch"}, {0.1 * i, 1}};
    const ImageMessage image{time_s, 4, 4, 12, "bgr8", false, std::vector<std::uint8_t>(48, 9)};
    all.push_back({"/joints", joint_type, time_s, ros2 ? testing::cdr_bytes(joints) : testing::ros1_bytes(joints)});
    all.push_back({"/image", image_type, time_s, ros2 ? testing::cdr_bytes(image) : testing::ros1_bytes(image)});
  }
  return all;
}

struct Tally {
  int read = 0, refused = 0;
};

void read_all(const std::filesystem::path& path, const std::string& content, Tally& tally) {
  testing::write_file(path, content);
  try {
    const auto bag = open_bag(path.string());
    std::size_t messages = 0;
    for (const BagTopic& topic : bag->topics())
      for (const auto from = bag->messages(topic); from->next();) ++messages;
    EXPECT_LE(messages, content.size());
    ++tally.read;
  } catch (const InputError&) {
    ++tally.refused;
  }
}

Tally damaged(const std::filesystem::path& path, const std::string& whole) {
  Tally tally;
  Random random(1);
  constexpr int cuts = 40, flips = 300;
  for (int i = 0; i < cuts; ++i)
    read_all(path, whole.substr(0, whole.size() * static_cast<std::size_t>(i) / cuts), tally);
  for (int i = 0; i < flips; ++i) {
    std::string content = whole;
    for (int k = 0; k <= i % 3; ++k)
      content[random.bits() % content.size()] ^= static_cast<char>(1u << random.bits() % 8);
    read_all(path, content, tally);
  }
  return tally;
}

TEST(DamagedBags, OfRos1AreReadOrRefused) {
  const testing::TemporaryFolder folder;
  for (const char* compression : {"none", "bz2", "lz4"}) {
    SCOPED_TRACE(compression);
    testing::write_ros1_bag(folder / "whole.bag", entries(false), compression);
    const Tally tally = damaged(folder / "damaged.bag", testing::read_file(folder / "whole.bag"));
    EXPECT_GT(tally.refused, 50);
    EXPECT_GT(tally.read, 30);  // a pixel, a number, the header's padding
  }
}

TEST(DamagedBags, OfRos2AreReadOrRefused) {
  const testing::TemporaryFolder folder;
  testing::write_ros2_bag(folder / "whole.db3", entries(true));
  const Tally tally = damaged(folder / "damaged.db3", testing::read_file(folder / "whole.db3"));
  EXPECT_GT(tally.refused, 50);
  EXPECT_GT(tally.read, 30);
}

}  // namespace
}  // namespace lapservo::internal
