#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"

namespace lapservo {

struct Instrument {
  std::string name;
  Marker marker;
  std::optional<Rigid3> camera_from_rcm;
};

/// What stands before the camera and which camera it is (CONVENTIONS "rig.yaml").
struct Rig {
  Camera camera;
  std::vector<Instrument> instruments;
  std::filesystem::path camera_file{};  ///< where the camera was read from, when it has a file of its own
};

/// Reads and checks everything: after it, the camera can be inverted over its whole image and every marker decoded.
/// Throws InputError naming file, field, value and what was expected.
Rig load_rig(const std::filesystem::path& path);

/// The same from text; `source` stands for the file's name in errors, `folder` is where a camera file is looked for.
Rig parse_rig(std::string_view yaml, const std::string& source, const std::filesystem::path& folder = ".");

}  // namespace lapservo
