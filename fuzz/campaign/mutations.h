#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <sstream>
#include <string>
#include <vector>

#include "lapservo/core/random.h"

namespace lapservo::fuzz {
using namespace internal;

inline std::size_t below(std::size_t count, Random& random) {
  return random.bits() % std::max<std::size_t>(count, 1);
}

inline std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// A YAML text with one thing done to it that people do: a letter of a line wrong, a line lost, doubled, moved or
/// indented otherwise, a value replaced by one of another kind, a line of other YAML put in.
inline std::string mutated_yaml(const std::string& text, Random& random) {
  static constexpr std::array values{"",          "~",    "nan",    ".inf",    "-1",    "0",    "1e308",
                                     "1e-320",    "[]",   "{}",     "'x'",     "true",  "*a",   "&a 1",
                                     "[1, 2, 3]", "0x10", "1280px", "!!str 1", "- - -", "[[[[["};
  static constexpr std::array inserted{"---",
                                       "<<: {seam_rad: 1}",
                                       "seem_rad: 1",
                                       "  joints: {}",
                                       "? [a]",
                                       "%YAML 1.2",
                                       "    seam_rad: 0.5",
                                       "# comment",
                                       "camera: /dev/zero",
                                       "instruments:",
                                       "      hues_dg: [1]",
                                       "      sigma_seam_rad: 1",
                                       "\t"};
  std::vector<std::string> lines = lines_of(text);
  const std::size_t at = below(lines.size(), random), other = below(lines.size(), random);
  switch (random.bits() % 8) {
    case 0:
      if (!lines[at].empty()) lines[at][below(lines[at].size(), random)] = static_cast<char>(' ' + random.bits() % 95);
      break;
    case 1:
      lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(at));
      break;
    case 2:
      lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(other), lines[at]);
      break;
    case 3:
      std::swap(lines[at], lines[other]);
      break;
    case 4:
      lines[at].insert(0, random.bits() % 3, ' ');
      break;
    case 5:
      if (const auto colon = lines[at].find(": "); colon != std::string::npos)
        lines[at] = lines[at].substr(0, colon + 2) + values[below(values.size(), random)];
      break;
    case 6:
      lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at), inserted[below(inserted.size(), random)]);
      break;
    default:
      if (const auto digit = lines[at].find_first_of("0123456789"); digit != std::string::npos)
        lines[at].replace(digit, 1, values[below(values.size(), random)]);
  }
  std::string joined;
  for (const std::string& line : lines) joined += line + '\n';
  return joined;
}

/// Bytes with one to three accidents of disks and networks: a bit flipped, a stretch lost, doubled or zeroed.
inline std::string mutated_bytes(std::string bytes, Random& random) {
  for (std::uint64_t n = 1 + random.bits() % 3; n > 0 && !bytes.empty(); --n) {
    const std::size_t at = below(bytes.size(), random);
    const std::size_t length = std::min(1 + below(400, random), bytes.size() - at);
    switch (random.bits() % 5) {
      case 0:
        bytes.erase(at, length);
        break;
      case 1:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 2:
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
        break;
      default:
        bytes[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1U << random.bits() % 8));
    }
  }
  return bytes;
}

}  // namespace lapservo::fuzz
