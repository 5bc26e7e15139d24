#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace lapservo::internal {

/// The DDS topic of a ROS 2 topic: "rt/PSM1/measured_js" of "/PSM1/measured_js" or, in the root namespace,
/// "PSM1/measured_js". Throws InputError for what is no name of a topic.
std::string dds_topic_name(const std::string& topic);

/// Back: "/PSM1/measured_js"; nullopt for what is no topic of ROS 2's messages (services, discovery).
std::optional<std::string> ros2_topic_name(std::string_view dds_topic);
/// "sensor_msgs/msg/Image" of DDS's "sensor_msgs::msg::dds_::Image_".
std::string ros2_type_name(std::string_view dds_type);

/// The domain that a text, as in ROS_DOMAIN_ID, names: 0 to 232, 0 for an empty one. Throws InputError.
std::uint32_t domain_id(const std::string& text);

}  // namespace lapservo::internal
