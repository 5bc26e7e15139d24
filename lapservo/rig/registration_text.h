#pragma once

namespace lapservo::internal {

/// How track, check and servo name images that contradict camera_from_rcm, and what to do.
inline constexpr auto misses_rcm_text = "the shaft misses the rig's RCM";
inline constexpr auto measure_registration_text = "lapservo calibrate registration measures camera_from_rcm";

}  // namespace lapservo::internal
