#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

// Not their header: what includes rosbag's is C++17.
namespace lapservo::internal {
struct JointMessage;
struct ImageMessage;
struct CompressedImageMessage;
struct PlaceMessage;
}  // namespace lapservo::internal

namespace lapservo::testing {

/// A message as it goes into a bag.
struct BagEntry {
  std::string topic, type;  ///< the type as in ROS 1
  double time_s = 0;        ///< of its recording
  std::vector<std::uint8_t> bytes;
};

/// As roscpp writes them.
template <typename Message>
std::vector<std::uint8_t> ros1_bytes(const Message& message);

/// As Fast CDR writes them.
std::vector<std::uint8_t> cdr_bytes(const internal::JointMessage& message, bool big_endian = false);
std::vector<std::uint8_t> cdr_bytes(const internal::ImageMessage& message, bool big_endian = false);
std::vector<std::uint8_t> cdr_bytes(const internal::CompressedImageMessage& message, bool big_endian = false);

/// By librosbag-storage; "none", "bz2" or "lz4".
void write_ros1_bag(const std::filesystem::path& path, const std::vector<BagEntry>& entries,
                    const std::string& compression = "none");
/// A .db3 with rosbag2's tables.
void write_ros2_bag(const std::filesystem::path& path, const std::vector<BagEntry>& entries);

struct McapLayout {
  std::string compression;           ///< "", "lz4" or "zstd"
  std::size_t messages_a_chunk = 3;  ///< 0: no chunks
  bool with_summary = true, with_checksums = true;
  std::size_t loose_every = 0;  ///< of so many messages one stands outside of chunks; 0: none
};
/// An MCAP file as its specification has it, by code that shares nothing with the reader.
void write_mcap(const std::filesystem::path& path, const std::vector<BagEntry>& entries, const McapLayout& layout = {});
/// The metadata.yaml of a folder with such files.
void write_ros2_metadata(const std::filesystem::path& folder, const std::vector<std::string>& files,
                         const std::string& storage = "sqlite3", const std::string& compression = "");

}  // namespace lapservo::testing
