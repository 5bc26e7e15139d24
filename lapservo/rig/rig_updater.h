#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "lapservo/rig/rig.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::internal {

/// A rig as it is written: a file's content, or what stands for one.
struct RigText {
  std::string yaml;
  std::filesystem::path path;  ///< where a camera file is looked for, and found

  /// Throws InputError as load_rig() does for what is no file.
  static RigText read(const std::filesystem::path& path);

  /// What load_rig() makes of the file, of this text: a pipe can be read only once. Throws InputError as it does.
  Rig rig() const;
};

/// The rig as YAML with another marker for one instrument, for a file at `destination`: every other entry stays as it
/// is written there, sigmas included; comments do not. A camera file is named so that it is found from
/// there. The rig must have been read without complaint (load_rig).
std::string updated_rig_yaml(const RigText& rig, const std::filesystem::path& destination, std::size_t instrument,
                             const Marker& marker);

/// Where an instrument stands before its camera, with one standard deviation each; without a value, what the file says
/// of it stays.
struct MeasuredRegistration {
  Rigid3 camera_from_rcm;
  std::array<double, 3> sigma_translation_m{};
  std::optional<std::array<double, 4>> sigma_quaternion_xyzw;  ///< nullopt: the rotation was not measured
  std::optional<Joints> joints;
  std::array<double, 4> sigma_offset{};  ///< of joints
  std::optional<double> image_delay_s;
  double sigma_image_delay_s = 0;
};

/// The same, with another registration.
std::string updated_rig_yaml(const RigText& rig, const std::filesystem::path& destination, std::size_t instrument,
                             const MeasuredRegistration& registration);

/// How a camera shows the bands of a marker, with one standard deviation of each hue; `response` without a value: as
/// the file has it.
struct MeasuredColour {
  std::array<double, 3> hues_deg{}, sigma_hues_deg{};
  std::optional<Response> response;
};

/// The same, with other colours. A response that is another goes into the rig itself, with what stands beside it,
/// whatever file the camera came from.
std::string updated_rig_yaml(const RigText& rig, const std::filesystem::path& destination, std::size_t instrument,
                             const MeasuredColour& colour);

/// measured_camera_yaml() of a camera that was a rig's: where its response was not measured it is the rig's, whose
/// sigma_response stays.
std::string measured_camera_yaml(const RigText& rig, const Camera& camera, CameraSigmas sigmas);

/// The rig with that camera, which stands in the rig itself whatever file the old one came from.
std::string updated_rig_yaml(const RigText& rig, const Camera& camera, const CameraSigmas& sigmas);

/// Whether a rig's camera has a response that was measured: sigma_response stands beside it. The rig must have been
/// read without complaint.
bool is_response_measured(const RigText& rig);

/// That sigma_response; NaN where it is no number. Nullopt for 0, too, by which earlier versions said that it was not
/// measured.
std::optional<double> sigma_of_response(const RigText& rig);

/// What one of these made for a file at `rig.path`, for one at `destination`: a camera file is found from there.
std::string moved_rig_yaml(const RigText& rig, const std::filesystem::path& destination);

}  // namespace lapservo::internal
