#pragma once

#include <algorithm>
#include <string>

namespace lapservo::internal {

/// ASCII letters only, whatever the locale.
inline std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return text;
}

}  // namespace lapservo::internal
