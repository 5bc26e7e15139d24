#pragma once

#include <cstddef>
#include <optional>
#include <string_view>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Place in Rig::instruments of the one with this name.
inline std::optional<std::size_t> instrument_index(const Rig& rig, std::string_view name) {
  for (std::size_t i = 0; i < rig.instruments.size(); ++i)
    if (rig.instruments[i].name == name) return i;
  return std::nullopt;
}

}  // namespace lapservo::internal
