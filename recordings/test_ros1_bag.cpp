// rosbag's own writer. In C++17: of its headers no more can be had.
#include <cstring>
#include <rosbag/bag.h>

#include "recordings/test_bags.h"

namespace {

struct Raw {
  const char* type;
  const std::uint8_t* data;
  std::uint32_t size;
};

}  // namespace

namespace ros {
namespace message_traits {

template <>
struct MD5Sum<Raw> {
  static const char* value() { return "*"; }
  static const char* value(const Raw&) { return value(); }
};

template <>
struct DataType<Raw> {
  static const char* value() { return "*"; }
  static const char* value(const Raw& raw) { return raw.type; }
};

template <>
struct Definition<Raw> {
  static const char* value() { return ""; }
  static const char* value(const Raw&) { return value(); }
};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<Raw> {
  template <typename Stream>
  static void write(Stream& stream, const Raw& raw) {
    std::memcpy(stream.advance(raw.size), raw.data, raw.size);
  }
  static std::uint32_t serializedLength(const Raw& raw) { return raw.size; }
};

}  // namespace serialization
}  // namespace ros

namespace lapservo::testing {

void write_ros1_bag(const std::filesystem::path& path, const std::vector<BagEntry>& entries,
                    const std::string& compression) {
  rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
  bag.setCompression(compression == "bz2"   ? rosbag::compression::BZ2
                     : compression == "lz4" ? rosbag::compression::LZ4
                                            : rosbag::compression::Uncompressed);
  bag.setChunkThreshold(4096);
  for (const BagEntry& entry : entries)
    bag.write(entry.topic, ros::Time(entry.time_s),
              Raw{entry.type.c_str(), entry.bytes.data(), static_cast<std::uint32_t>(entry.bytes.size())});
}

}  // namespace lapservo::testing
