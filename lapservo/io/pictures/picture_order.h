#pragma once

#include <filesystem>
#include <vector>

namespace lapservo::internal {

struct PictureOrder {
  std::vector<std::filesystem::path> files;
  bool is_ambiguous = false;  ///< points or signs in the names decide, which others read as text
};

/// The images of one folder by name, numbers in names by value: a name without a number before the same with one; a
/// point between two numbers as a decimal point, unless the decimals differ in their count and end in 0, as counts do
/// (1.9, 1.10); a minus as a sign where it begins the name, or where another name has the number without it.
PictureOrder ordered_pictures(std::vector<std::filesystem::path> files);

}  // namespace lapservo::internal
