#pragma once

#include <cctype>
#include <regex>
#include <string>
#include <vector>

namespace lapservo::testing {

/// Empty when the text is well-formed markup: tags balanced and nested, attributes quoted and unique, no stray < or &.
/// Enough of XML for what we write.
inline std::string markup_problem(const std::string& text) {
  std::vector<std::string> open;
  static const std::regex entity("&(amp|lt|gt|quot|#39);.*", std::regex::extended);
  for (std::size_t i = 0; i < text.size();) {
    if (text[i] == '&') {
      const std::string rest = text.substr(i, 8);
      if (!std::regex_match(rest.substr(0, rest.find(';') + 1), entity)) return "stray & at " + text.substr(i, 40);
      ++i;
      continue;
    }
    if (text[i] != '<') {
      ++i;
      continue;
    }
    if (text.compare(i, 9, "<!DOCTYPE") == 0) {
      i = text.find('>', i) + 1;
      continue;
    }
    std::size_t at = i + 1;
    const bool closing = text[at] == '/';
    if (closing) ++at;
    const std::size_t name_start = at;
    while (at < text.size() && std::isalnum(static_cast<unsigned char>(text[at]))) ++at;
    const std::string name = text.substr(name_start, at - name_start);
    if (name.empty()) return "stray < at " + text.substr(i, 40);
    std::vector<std::string> attributes;
    while (at < text.size() && text[at] == ' ') {
      const std::size_t equals = text.find('=', ++at);
      const std::string attribute = text.substr(at, equals - at);
      for (const std::string& other : attributes)
        if (other == attribute) return "attribute twice: " + attribute;
      attributes.push_back(attribute);
      if (equals == std::string::npos || text[equals + 1] != '"') return "attribute without quotes in " + name;
      const std::size_t end = text.find('"', equals + 2);
      if (end == std::string::npos) return "attribute without end in " + name;
      const std::string value = text.substr(equals + 2, end - equals - 2);
      if (value.find('<') != std::string::npos) return "< in an attribute of " + name;
      at = end + 1;
    }
    const bool empty = text[at] == '/';
    if (empty) ++at;
    if (text[at] != '>') return "tag " + name + " is not closed: " + text.substr(i, 60);
    if (closing) {
      if (open.empty() || open.back() != name) return "</" + name + "> closes nothing";
      open.pop_back();
    } else if (!empty) {
      open.push_back(name);
    }
    i = at + 1;
  }
  return open.empty() ? "" : "<" + open.back() + "> stays open";
}

}  // namespace lapservo::testing
