#pragma once

#include <cstdint>
#include <vector>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// A message's bytes as ROS 2 records and sends them: OMG's CDR, XCDR1, little-endian, behind four bytes that say so.
/// Stamps must be numbers. Velocities and efforts are left empty.
std::vector<std::uint8_t> encode_cdr(const JointMessage& message);
std::vector<std::uint8_t> encode_cdr(const ImageMessage& message);
std::vector<std::uint8_t> encode_cdr(const CompressedImageMessage& message);

}  // namespace lapservo::internal
