#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

namespace lapservo {

/// CRTK's operating states.
enum class ArmState { disabled, enabled, paused, fault };
std::string_view state_word(ArmState state);
std::optional<ArmState> state_from_word(std::string_view word);

/// What an arm says of itself (CRTK measured_js and operating_state). Joints: theta_rad, phi_rad, rho_m, psi_rad.
struct ArmReading {
  Eigen::Vector4d q_joint = Eigen::Vector4d::Zero();
  ArmState state = ArmState::disabled;
};

}  // namespace lapservo
