#pragma once

#include <cstddef>
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>

/// Fast CDR as ROS 2 uses it, of version 1 (Debian 12) and 2 (Debian 13).
namespace lapservo::testing {

#if __has_include(<fastcdr/CdrEncoding.hpp>)
inline constexpr auto ros2_cdr = eprosima::fastcdr::CdrVersion::DDS_CDR;
inline std::size_t bytes_of(const eprosima::fastcdr::Cdr& cdr) {
  return cdr.get_serialized_data_length();
}
#else
inline constexpr auto ros2_cdr = eprosima::fastcdr::Cdr::DDS_CDR;
inline std::size_t bytes_of(const eprosima::fastcdr::Cdr& cdr) {
  return cdr.getSerializedDataLength();
}
#endif

}  // namespace lapservo::testing
