#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "lapservo/control/controller_config.h"

namespace lapservo {

/// Reads a controller's YAML over `base`: any key may be missing, none may be unknown. Keys: mode, period_s,
/// gains_per_s (s r l d), delay_s (a number, or `estimate`), limits {lower, upper, rate, acceleration} (theta phi rho
/// psi), window {u_min_px, u_max_px, v_min_px, v_max_px} (ideal pixels). Throws InputError naming file, field, value
/// and expectation.
ControllerConfig load_controller(const std::filesystem::path& path, const ControllerConfig& base);

/// `base`, with what a file says over it where there is one, for an arm with limits of its own where they are given:
/// they are the base's, and a file's may only be narrower. Throws InputError as load_controller() and checked() do.
ControllerConfig controller_for_arm(ControllerConfig base, const std::optional<std::filesystem::path>& file,
                                    const std::optional<JointLimits>& arm_limits);

/// Text of these keys, from which load_controller reads their values back to the same bits. It omits values that a file
/// cannot set (scales, observer except for its delay, Jacobian, probing, damping, conditions of holds).
std::string controller_yaml(const ControllerConfig& config);

}  // namespace lapservo
