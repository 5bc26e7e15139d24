#pragma once

#include <cstddef>
#include <string>

namespace lapservo::internal {

/// The beginning of a stranger's text as one line of plain letters, for messages.
inline std::string printable(const std::string& text, std::size_t longest = 40) {
  std::string shown = text.substr(0, longest);
  for (char& c : shown) c = c >= ' ' && c <= '~' ? c : '?';
  return shown;
}

/// Names, with commas between them.
template <typename Names>
std::string printable_names(const Names& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + printable(name);
  return text;
}

}  // namespace lapservo::internal
