#include "apps/lapservo/cli/command.h"

#include <limits>
#include <string>

#include <fmt/format.h>

#include "lapservo/core/csv.h"

namespace lapservo::app {
namespace {

CLI::Validator checked(const std::string& expected, bool whole, double low, double high) {
  const auto problem = [=](const std::string& text) {
    const auto value = internal::parse_finite(text);
    const bool good = value && *value >= low && *value <= high &&
                      (!whole || text.find_first_not_of("0123456789") == std::string::npos);
    return good ? std::string() : fmt::format("is {}, expected {}", text.empty() ? "empty" : text, expected);
  };
  return CLI::Validator(problem, "", "number");
}

}  // namespace

CLI::Validator number_between(double low, double high) {
  return checked(fmt::format("a number of {} to {}", low, high), false, low, high)
      .description(fmt::format("{} to {}", low, high));
}

CLI::Validator whole_number_between(double low, double high) {
  return checked(fmt::format("a whole number of {} to {}", low, high), true, low, high)
      .description(fmt::format("{} to {}", low, high));
}

CLI::Validator finite_number() {
  constexpr double any = std::numeric_limits<double>::max();
  return checked("a finite number", false, -any, any);
}

CLI::Validator seed_number() {
  constexpr double max_seed = 9007199254740991;  // 2^53 - 1: whole in a double too
  return checked("a whole number from 0 to 2^53 - 1", true, 0, max_seed);
}

}  // namespace lapservo::app
