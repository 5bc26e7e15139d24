#include "apps/lapservo/cli/command.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double max_seed = 9007199254740991;  // 2^53 - 1: whole in a double too

// To be the option's first check.
CLI::Validator checked(const std::string& expected, bool whole, double low, double high) {
  const auto problem = [=](const std::string& text) {
    const auto value = parse_finite(text);
    const bool good = value && *value >= low && *value <= high &&
                      (!whole || text.find_first_not_of("0123456789") == std::string::npos);
    return good ? std::string() : fmt::format("is {}, expected {}", text.empty() ? "empty" : text, expected);
  };
  return CLI::Validator(problem, "", "number");
}

}  // namespace

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::shows_default() {
  option_->capture_default_str();
  return *this;
}

Option& Option::hidden() {
  option_->group("");
  return *this;
}

Option& Option::expected(int count) {
  option_->expected(count);
  return *this;
}

Option& Option::without_value(const std::string& meant) {
  option_->expected(0, 1)->default_str(meant);
  return *this;
}

Option& Option::delimiter(char between_values) {
  option_->delimiter(between_values);
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& words) {
  option_->check(CLI::IsMember(words));
  return *this;
}

Option& Option::number_between(double low, double high) {
  option_->check(checked(fmt::format("a number of {} to {}", low, high), false, low, high)
                     .description(fmt::format("{} to {}", low, high)));
  return *this;
}

Option& Option::whole_number_between(double low, double high) {
  option_->check(checked(fmt::format("a whole number of {} to {}", low, high), true, low, high)
                     .description(fmt::format("{} to {}", low, high)));
  return *this;
}

Option& Option::finite_number() {
  constexpr double any = std::numeric_limits<double>::max();
  option_->check(checked("a finite number", false, -any, any));
  return *this;
}

Option& Option::seed_number() {
  option_->check(checked("a whole number from 0 to 2^53 - 1", true, 0, max_seed));
  return *this;
}

Command Command::add_subcommand(const std::string& name, const std::string& about) {
  return Command(app_->add_subcommand(name, about));
}

void Command::require_subcommand() {
  app_->require_subcommand(1);
}

template <typename Value>
Option Command::add_option(const std::string& names, Value& value, const std::string& help) {
  return Option(app_->add_option(names, value, help));
}

template Option Command::add_option(const std::string&, double&, const std::string&);
template Option Command::add_option(const std::string&, int&, const std::string&);
template Option Command::add_option(const std::string&, std::uint64_t&, const std::string&);
template Option Command::add_option(const std::string&, std::string&, const std::string&);
template Option Command::add_option(const std::string&, std::optional<double>&, const std::string&);
template Option Command::add_option(const std::string&, std::optional<int>&, const std::string&);
template Option Command::add_option(const std::string&, std::vector<double>&, const std::string&);
template Option Command::add_option(const std::string&, std::vector<std::string>&, const std::string&);

void Command::add_flag(const std::string& names, bool& value, const std::string& help) {
  app_->add_flag(names, value, help);
}

void Command::footer(const std::string& text) {
  app_->footer(text);
}

void Command::runs(Run& run_later, Run run) {
  app_->callback([&run_later, run = std::move(run)] { run_later = run; });
}

}  // namespace lapservo::app
