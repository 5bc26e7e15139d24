#pragma once

#include <cstdint>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

// The fields after the header of messages that are the same in ROS 1 and 2, in their order. `From` gives numbers, texts
// and sequences as either writes them.

template <typename From>
void read_fields(From& from, JointMessage& message) {
  message.names = from.texts();
  message.positions = from.template numbers<double>();
  from.template numbers<double>();  // velocity
  from.template numbers<double>();  // effort
}

template <typename From>
void read_fields(From& from, ImageMessage& message) {
  message.height = from.template number<std::uint32_t>();
  message.width = from.template number<std::uint32_t>();
  message.encoding = from.text();
  message.is_bigendian = from.template number<std::uint8_t>() != 0;
  message.step = from.template number<std::uint32_t>();
  message.data = from.template numbers<std::uint8_t>();
}

template <typename From>
void read_fields(From& from, CompressedImageMessage& message) {
  message.format = from.text();
  message.data = from.template numbers<std::uint8_t>();
}

}  // namespace lapservo::internal
