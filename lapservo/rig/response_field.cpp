#include "lapservo/rig/response_field.h"

#include <optional>
#include <string>

#include "lapservo/core/csv.h"
#include "lapservo/core/known_keys.h"

namespace lapservo::internal {
namespace {

std::vector<double> rising_from_0_to_1(const YamlField& field) {
  constexpr auto expected = "2 to 4096 numbers that rise from 0 to 1";
  std::vector<double> numbers;
  for (const YamlField& item : field.list(expected)) {
    numbers.push_back(item.number_between(0, 1, expected));
    if (numbers.size() > 1 && !(numbers.back() > numbers[numbers.size() - 2])) item.fail(item.value_text(), expected);
  }
  if (numbers.size() < 2 || numbers.size() > 4096 || numbers.front() != 0 || numbers.back() != 1)
    field.fail(field.value_text(), expected);
  return numbers;
}

std::vector<double> sigmas_like(const YamlField& field, std::size_t size) {
  std::vector<double> sigmas;
  for (const YamlField& item : field.list(sigmas_expected)) sigmas.push_back(item.number(sigmas_expected));
  if (sigmas.size() != size) field.fail(field.value_text(), sigmas_expected);
  return sigmas;
}

Response parse_table(const YamlField& field) {
  expect_keys(field, {{}, {"light", "value"}});
  Response response{Response::Kind::table, 1, rising_from_0_to_1(field["light"]), rising_from_0_to_1(field["value"])};
  if (response.table_light.size() != response.table_value.size())
    field["value"].fail(field["value"].value_text(), "as many numbers as light has");
  if (const YamlField sigmas = field["sigma_light"]; sigmas.present())
    response.sigma_light = sigmas_like(sigmas, response.table_light.size());
  if (const YamlField sigmas = field["sigma_value"]; sigmas.present())
    response.sigma_value = sigmas_like(sigmas, response.table_value.size());
  return response;
}

}  // namespace

Response parse_response(const YamlField& field) {
  constexpr auto expected = "srgb, rec709, linear, gamma:VALUE with a value of 0.2 to 5, or a table of light and value";
  if (!field.present()) return {};
  if (field.is_map()) return parse_table(field);
  const std::string text = field.text(expected);
  if (text == "srgb") return {};
  if (text == "rec709") return {Response::Kind::rec709};
  if (text == "linear") return {Response::Kind::power, 1};
  constexpr std::string_view prefix = "gamma:";
  const auto gamma =
      text.starts_with(prefix) ? parse_finite(std::string_view(text).substr(prefix.size())) : std::nullopt;
  if (!gamma || *gamma < 0.2 || *gamma > 5) field.fail(text, expected);
  return {Response::Kind::power, *gamma};
}

}  // namespace lapservo::internal
