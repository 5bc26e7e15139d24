#pragma once

#include "lapservo/vision/status.h"

namespace lapservo::internal {

/// Why frames have this status, other than ok, and what helps, as docs/statuses.md has it: "CAUSE; REMEDY" without a
/// full stop.
const char* usual_cause(Status status);

/// Whether compression refuses frames by this status.
constexpr bool comes_by_compression(Status status) {
  return status == Status::poor_fit || status == Status::uncertain || status == Status::ambiguous;
}

}  // namespace lapservo::internal
