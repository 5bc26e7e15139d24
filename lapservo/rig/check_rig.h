#pragma once

#include <cstddef>
#include <optional>

#include "lapservo/core/error.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Throws InputError naming field, value and expectation for a rig that was put together in a program and that nothing
/// can be seen with: no instrument, a camera without size or focal length, numbers that are not finite, a marker that
/// is none, two instruments that their colours do not distinguish.
void check_rig(const Rig& rig);

inline constexpr std::size_t most_instruments = 8;
/// The problem of a marker's hues_deg beside those of an instrument before it; nullopt where they name the instrument.
std::optional<FieldProblem> hues_problem(const Marker& marker, const Instrument& other);

}  // namespace lapservo::internal
