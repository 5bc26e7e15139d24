#include "apps/lapservo/cli/command.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <optional>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/nearest_word.h"

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

// The first word of a command line that is no command or option, with the nearest that is one: "; trak is unknown, the
// nearest is track"; empty where all are known.
std::string suggestion(const CLI::App& program, int argc, char** argv) {
  const CLI::App* command = &program;
  for (int i = 1; i < argc; ++i) {
    const std::string word = std::string(argv[i]).substr(0, std::string(argv[i]).find('='));
    std::vector<std::string> known;
    if (word.starts_with("--")) {
      for (const CLI::Option* option : command->get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    } else if (command->get_require_subcommand_min() > 0) {
      for (const CLI::App* subcommand : command->get_subcommands([](const CLI::App*) { return true; }))
        known.push_back(subcommand->get_name());
    }
    if (known.empty()) continue;
    if (std::find(known.begin(), known.end(), word) == known.end())
      return "; " + word + " is unknown, the nearest is " + nearest_word(word, known);
    if (!word.starts_with("--")) command = command->get_subcommand(word);
  }
  return "";
}

}  // namespace

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::without_value(const std::string& meant) {
  option_->expected(0, 1)->default_str(meant);
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

Option& Option::finite_numbers(std::optional<int> count) {
  constexpr double any = std::numeric_limits<double>::max();
  option_->check(checked("a finite number", false, -any, any))->delimiter(',');
  if (count) option_->expected(*count);
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
  CLI::Option* option = app_->add_option(names, value, help)->capture_default_str();
  if (option->get_default_str() == "[]") option->default_str("");
  return Option(option);
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

std::vector<std::string> Command::given() const {
  std::vector<std::string> names;
  for (const CLI::Option* option : app_->get_options())
    if (option->count() > 0) names.push_back(option->get_name());
  return names;
}

void Command::refuse(const std::vector<std::string>& names, const std::string& why) const {
  for (const std::string& name : given())
    if (std::find(names.begin(), names.end(), name) != names.end()) throw InputError(name, why);
}

void Command::runs(Run& run_later, Run run) {
  app_->callback([&run_later, run = std::move(run)] { run_later = run; });
}

int run_subcommand(int argc, char** argv, const std::string& version, const std::vector<AddSubcommand>& subcommands) {
  CLI::App app{"See and steer a laparoscopic instrument by its camera.", "lapservo"};
  app.set_version_flag("--version", "lapservo " + version);
  app.require_subcommand(1);
  app.footer(
      "`lapservo SUBCOMMAND --help` shows its options and an example.\n"
      "Exit codes: 0 done, 1 found nothing or did not converge, 2 bad input.");
  Run run;
  for (const AddSubcommand add : subcommands) add(Command(&app), run);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "lapservo: %s%s (try --help)\n", error.what(), suggestion(app, argc, argv).c_str());
    return bad_input;
  }
  return run();
}

}  // namespace lapservo::app
