#pragma once

#include <filesystem>
#include <vector>

#include "lapservo/core/csv.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Where every instrument of a rig is in one frame, in the rig's order.
using Configurations = std::vector<JointVector>;

/// Configurations frame by frame from a table with the columns theta_rad, phi_rad, rho_m, psi_rad: a row per frame and
/// instrument, in the rig's order unless a column `instrument` names them (in truth.csv it does).
/// Throws InputError, naming `source`, for anything else: a missing number, rows for a part of the instruments, an
/// instrument that the rig does not have or that a frame has twice.
std::vector<Configurations> configurations_from(const CsvTable& table, const Rig& rig, const std::string& source);
std::vector<Configurations> read_configurations(const std::filesystem::path& path, const Rig& rig);

}  // namespace lapservo::internal
