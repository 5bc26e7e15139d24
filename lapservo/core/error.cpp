#include "lapservo/core/error.h"

#include <algorithm>

namespace lapservo {
namespace {

// Names and values come from files that may hold anything: the message stays one printable line.
std::string printable(std::string text) {
  const auto is_control = [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 0x7f; };
  std::replace_if(text.begin(), text.end(), is_control, ' ');
  return text;
}

// Not cut within a UTF-8 character, whose later bytes are 10xxxxxx.
std::string shortened(std::string_view text) {
  constexpr std::size_t longest = 80;
  if (text.size() <= longest) return std::string(text);
  std::size_t end = longest;
  while (end > longest - 4 && (static_cast<unsigned char>(text[end]) & 0xc0) == 0x80) --end;
  return std::string(text.substr(0, end)) + "...";
}

std::string message(std::string_view source, std::string_view field, std::string_view value,
                    std::string_view expected) {
  std::string text(source);
  if (!source.empty() && !field.empty()) text.append(": ");
  text.append(field) += ": is " + (value.empty() ? "empty" : shortened(value)) + ", expected ";
  return text.append(expected);
}

}  // namespace

std::string FieldProblem::text() const {
  return printable(message("", field, value, expectation));
}

InputError::InputError(std::string_view source, const FieldProblem& problem)
    : InputError(source, problem.field, problem.value, problem.expectation) {}

InputError::InputError(std::string_view source, std::string_view field, std::string_view value,
                       std::string_view expected)
    : std::runtime_error(printable(message(source, field, value, expected))),
      parts_(std::make_shared<const Parts>(
          Parts{std::string(source), std::string(field), std::string(value), std::string(expected), ""})) {}

InputError::InputError(std::string_view source, std::string_view problem)
    : std::runtime_error(printable(std::string(source).append(": ").append(problem))),
      parts_(std::make_shared<const Parts>(Parts{std::string(source), "", "", "", std::string(problem)})) {}

InputError InputError::with_source(std::string_view source) const {
  if (parts_->expectation.empty()) return {source, parts_->problem};
  return {source, parts_->field, parts_->value, parts_->expectation};
}

}  // namespace lapservo
