#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

namespace lapservo::testing {

inline std::size_t count_of(const std::string& text, const std::string& what) {
  std::size_t count = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

/// The fault of a tag's attributes, each ` name="value"`; cuts them off.
inline std::string attribute_problem(std::string& tag) {
  std::set<std::string> names;
  while (tag.ends_with('"')) {
    const std::size_t value = tag.rfind("=\"", tag.size() - 3), name = tag.rfind(' ', value);
    if (value == std::string::npos || name == std::string::npos) return "attribute without a name or quotes: " + tag;
    if (!names.insert(tag.substr(name + 1, value - name - 1)).second) return "attribute twice: " + tag;
    tag.resize(name);
  }
  return tag.find_first_of(" =\"") == std::string::npos ? "" : "attribute without quotes: " + tag;
}

/// Empty when the text is well-formed markup: tags balanced and nested, attributes quoted and unique, no stray < or &.
/// Enough of XML for what we write.
inline std::string markup_problem(const std::string& text) {
  std::vector<std::string> open;
  for (std::size_t i = 0; (i = text.find_first_of("<&", i)) != std::string::npos; ++i) {
    const std::string start = text.substr(i, 60);
    if (text[i] == '&') {
      const std::set<std::string> entities{"&amp;", "&lt;", "&gt;", "&quot;", "&#39;"};
      if (!entities.contains(start.substr(0, start.find(';') + 1))) return "stray &: " + start;
      continue;
    }
    const std::size_t end = text.find('>', i);
    if (end == std::string::npos || text.find('<', i + 1) < end) return "not closed: " + start;
    std::string tag = text.substr(i + 1, end - i - 1);
    if (tag.starts_with("!DOCTYPE")) continue;
    const bool closing = tag.starts_with('/'), empty = tag.ends_with('/');
    tag = tag.substr(closing, tag.size() - closing - empty);
    if (const std::string problem = attribute_problem(tag); !problem.empty()) return problem;
    if (tag.empty()) return "stray <: " + start;
    if (closing && (open.empty() || open.back() != tag)) return "</" + tag + "> closes nothing";
    if (closing)
      open.pop_back();
    else if (!empty)
      open.push_back(tag);
  }
  return open.empty() ? "" : "<" + open.back() + "> stays open";
}

}  // namespace lapservo::testing
