#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// A topic of a bag.
struct BagTopic {
  std::string name, type;  ///< the type as in ROS 1: sensor_msgs/Image
  std::uint64_t messages = 0;
  double duration_s = 0;  ///< from about its first message's recording to about its last one's
};

/// std::monostate: bytes that are no message of the topic's type, or of one that is not read here.
using BagMessage = std::variant<std::monostate, JointMessage, ImageMessage, CompressedImageMessage, PlaceMessage>;

/// A topic's messages as they were recorded, one after the other.
class BagMessages {
 public:
  virtual ~BagMessages() = default;
  /// nullopt at the end. Throws InputError where the bag is damaged.
  virtual std::optional<BagMessage> next() = 0;
  /// When the latest was recorded, by the recorder's clock.
  virtual double recorded_s() const = 0;
};

/// The port to a recording of ROS 1 or 2.
class Bag {
 public:
  virtual ~Bag() = default;
  /// As it was named.
  const std::string& path() const { return path_; }
  const std::vector<BagTopic>& topics() const { return topics_; }
  /// Which files beside it are not read and why; empty where there are none.
  const std::string& remark() const { return remark_; }
  /// The messages of one of topics(). The bag must outlive it.
  virtual std::unique_ptr<BagMessages> messages(const BagTopic& topic) const = 0;

 protected:
  explicit Bag(const std::string& path) : path_(path) {}

  std::string path_, remark_;
  std::vector<BagTopic> topics_;
};

inline constexpr const char* joint_type = "sensor_msgs/JointState";
inline constexpr const char* image_type = "sensor_msgs/Image";
inline constexpr const char* compressed_image_type = "sensor_msgs/CompressedImage";
inline constexpr const char* place_type = "geometry_msgs/PoseStamped";

/// The type of topics that carry such messages.
template <typename Message>
constexpr const char* bag_type = std::is_same_v<Message, JointMessage>   ? joint_type
                                 : std::is_same_v<Message, ImageMessage> ? image_type
                                                                         : compressed_image_type;

/// The result of `decode.operator()<Message>(bytes)` for a message's bytes.
template <typename Decode, typename Bytes>
BagMessage decode_bag_message(const std::string& type, const Decode& decode, const Bytes& bytes) {
  const auto message = [](auto decoded) { return decoded ? BagMessage(std::move(*decoded)) : BagMessage(); };
  if (type == joint_type) return message(decode.template operator()<JointMessage>(bytes));
  if (type == image_type) return message(decode.template operator()<ImageMessage>(bytes));
  if (type == place_type) return message(decode.template operator()<PlaceMessage>(bytes));
  if (type == compressed_image_type) return message(decode.template operator()<CompressedImageMessage>(bytes));
  return {};
}

}  // namespace lapservo::internal
