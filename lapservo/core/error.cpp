#include "lapservo/core/error.h"

#include <algorithm>

namespace lapservo {
namespace {

// Values come from files that may hold anything: the message stays one printable line.
std::string one_line(std::string_view text) {
  constexpr std::size_t longest = 80;
  std::string line(text.substr(0, longest));
  std::replace_if(
      line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 0x7f; }, ' ');
  return text.size() > longest ? line + "..." : line;
}

std::string message(std::string_view source, std::string_view field, std::string_view value,
                    std::string_view expected) {
  std::string text(source);
  if (!field.empty()) text.append(": ").append(field);
  text.append(": is ").append(value.empty() ? "empty" : one_line(value)).append(", expected ").append(expected);
  return text;
}

}  // namespace

InputError::InputError(std::string_view source, std::string_view field, std::string_view value,
                       std::string_view expected)
    : std::runtime_error(message(source, field, value, expected)) {}

InputError::InputError(std::string_view source, std::string_view problem)
    : std::runtime_error(std::string(source).append(": ").append(problem)) {}

}  // namespace lapservo
