#pragma once

#include <optional>
#include <string_view>

namespace lapservo {

/// CRTK's operating states.
enum class OperatingState { disabled, enabled, paused, fault };
/// "DISABLED", "ENABLED", "PAUSED", "FAULT".
std::string_view to_string(OperatingState state);
std::optional<OperatingState> operating_state_from_string(std::string_view word);

}  // namespace lapservo
