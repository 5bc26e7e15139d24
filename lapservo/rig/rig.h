#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"
#include "lapservo/tool/tool.h"

namespace lapservo {

/// The arm's joints behind theta, phi, rho and psi, in this order: q_i = sign_i * joint_i + offset_i, rad and m.
struct Joints {
  std::array<std::string, 4> names;
  std::array<double, 4> sign{1, 1, 1, 1};  ///< 1 or -1
  std::array<double, 4> offset{};
  std::optional<std::array<double, 4>> sigma_offset{};
  bool operator==(const Joints&) const = default;
};

/// `sigma_`: one standard deviation, where it was measured.
struct Instrument {
  std::string name;
  Marker marker;
  std::optional<Rigid3> camera_from_rcm;
  std::optional<Joints> joints{};
  std::optional<double> image_delay_s{};  ///< a frame's stamp minus the joints' clock at its exposure
  std::optional<std::array<double, 3>> sigma_translation_m{};  ///< of camera_from_rcm
  std::optional<std::array<double, 4>> sigma_quaternion_xyzw{};
  /// Covariance of its translation [m], then of a rotation vector about the camera's axes [rad].
  std::optional<Eigen::Matrix<double, 6, 6>> registration_covariance{};
  std::optional<double> sigma_image_delay_s{};
  std::optional<Tool> tool{};
  bool operator==(const Instrument&) const = default;
};

/// The scene before the camera, and the camera (docs/rig.md).
struct Rig {
  Camera camera;
  std::vector<Instrument> instruments;
  std::filesystem::path camera_file{};  ///< where the camera was read from, when it has a file of its own
  bool operator==(const Rig&) const = default;
};

/// Reads and checks everything: after it, the camera can be inverted within the largest circle amid its image and
/// every marker decoded.
/// Throws InputError naming file, field, value and what was expected.
Rig load_rig(const std::filesystem::path& path);

/// The same from text; `source` stands for the file's name in errors, `folder` is where a camera file is looked for.
Rig parse_rig(std::string_view yaml, const std::string& source, const std::filesystem::path& folder = ".");

}  // namespace lapservo
