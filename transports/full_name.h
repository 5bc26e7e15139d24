#pragma once

#include <string>

namespace lapservo::internal {

/// Whether a name is words of letters, digits and underscores, each behind one slash and beginning with a letter or,
/// where it may, with an underscore.
inline bool is_full_name(const std::string& name, bool may_begin_with_underscore) {
  if (name.size() < 2 || name.size() > 200 || name.front() != '/' || name.back() == '/') return false;
  char before = 0;
  for (const char c : name) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (!is_letter && !(c >= '0' && c <= '9') && c != '_' && c != '/') return false;
    if (before == '/' && !is_letter && !(may_begin_with_underscore && c == '_')) return false;
    before = c;
  }
  return true;
}

}  // namespace lapservo::internal
