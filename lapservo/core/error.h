#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace lapservo {

/// A configuration or an input that can't be used: thrown once, early. what() is one line naming source (a file, or an
/// option), field, value and expectation, for example
///   rig.yaml: instruments[0].marker.diameter_m: is -1, expected a number above 0
class InputError : public std::runtime_error {
 public:
  InputError(std::string_view source, std::string_view field, std::string_view value, std::string_view expected);
  /// For a source that has no fields: `source: problem`.
  InputError(std::string_view source, std::string_view problem);
};

}  // namespace lapservo
