#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::python {

/// A camera as Python holds it: it is known whether its response was measured.
struct PythonCamera : Camera {
  std::optional<double> sigma_response;  ///< of encoded values (0 to 1), NaN where a file has no number for it
};

/// The same of a rig.
struct PythonRig : Rig {
  std::optional<double> sigma_response;

  /// Text that parse() reads back to the last bit.
  std::string yaml() const;
  /// As parse_rig().
  static PythonRig parse(const std::string& yaml, const std::string& source, const std::filesystem::path& folder = ".");
};

}  // namespace lapservo::python
