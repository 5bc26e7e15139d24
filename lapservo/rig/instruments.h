#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The rig with its first instrument only. Throws InputError naming `source` when there is none.
Rig first_instrument(Rig rig, const std::string& source);

/// For the calibrated loop: throws InputError naming `source` where the first instrument has no camera_from_rcm.
void require_registration(const Rig& rig, const std::string& source);

/// The first instrument only, with camera_from_rcm, for the simulator and the experiments: throws InputError where it
/// is missing.
Rig single_instrument(Rig rig, const std::string& source);

/// Without its `sigma_` keys and covariances, but for those of tools.
Rig without_sigmas(Rig rig);

/// Place in Rig::instruments of the one with this name.
std::optional<std::size_t> instrument_index(const Rig& rig, std::string_view name);

/// That of the instrument that is named, or of the only one. Throws InputError where that is open, naming the rig, or
/// unknown, naming the `option` that has the name.
std::size_t named_instrument(const Rig& rig, const std::optional<std::string>& name, const std::string& rig_name,
                             const std::string& option);

}  // namespace lapservo::internal
