// rosbag's own writer. In C++17: of its headers no more can be had.
#include "recordings/test_ros1_bag.h"

#include <cstring>
#include <rosbag/bag.h>

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

namespace lapservo {
namespace testing {

struct Ros1BagWriter::Implementation {
  rosbag::Bag bag;
};

Ros1BagWriter::Ros1BagWriter(const std::string& path, const std::string& compression)
    : implementation_(std::make_unique<Implementation>()) {
  implementation_->bag.open(path, rosbag::bagmode::Write);
  implementation_->bag.setCompression(compression == "bz2"   ? rosbag::compression::BZ2
                                      : compression == "lz4" ? rosbag::compression::LZ4
                                                             : rosbag::compression::Uncompressed);
  implementation_->bag.setChunkThreshold(4096);
}

Ros1BagWriter::~Ros1BagWriter() = default;

void Ros1BagWriter::write(const std::string& topic, const std::string& type, double time_s, const std::uint8_t* data,
                          std::size_t size) {
  implementation_->bag.write(topic, ros::Time(time_s), Raw{type.c_str(), data, static_cast<std::uint32_t>(size)});
}

}  // namespace testing
}  // namespace lapservo
