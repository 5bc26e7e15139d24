#pragma once

namespace lapservo::internal {

/// Moments that differ by less, in seconds, are one: what is left are roundings.
constexpr double same_moment_s = 1e-9;

}  // namespace lapservo::internal
