#include "apps/lapservo/cli/command.h"

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <limits>
#include <optional>
#include <unistd.h>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <opencv2/core/utils/logger.hpp>

#include "apps/lapservo/cli/interrupt.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/nearest_word.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr int bad_input = 2;                   // the exit code
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

Rule number_between(const std::string& kind, bool whole, double low, double high) {
  const std::string range = fmt::format("{} to {}", low, high);
  return
      [=](CLI::Option& option) { option.check(checked(kind + " of " + range, whole, low, high).description(range)); };
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

Rule required(const Rule& rule) {
  return [=](CLI::Option& option) {
    if (rule) rule(option);
    option.required();
  };
}

Rule without_value(const std::string& meant, const Rule& rule) {
  return [=](CLI::Option& option) {
    rule(option);
    option.expected(0, 1)->default_str(meant);
  };
}

Rule one_of(const std::vector<std::string>& words) {
  return [=](CLI::Option& option) { option.check(CLI::IsMember(words)); };
}

Rule between(double low, double high) {
  return number_between("a number", false, low, high);
}

Rule whole_between(double low, double high) {
  return number_between("a whole number", true, low, high);
}

Rule finite_numbers(std::optional<int> count) {
  return [=](CLI::Option& option) {
    constexpr double any = std::numeric_limits<double>::max();
    option.check(checked("a finite number", false, -any, any))->delimiter(',');
    if (count) option.expected(*count);
  };
}

Rule seed_number() {
  return [](CLI::Option& option) { option.check(checked("a whole number from 0 to 2^53 - 1", true, 0, max_seed)); };
}

Command Command::add_subcommand(const std::string& name, const std::string& about) {
  return {app_->add_subcommand(name, about), chosen_};
}

void Command::require_subcommand() {
  app_->require_subcommand(1);
}

template <typename Value>
void Command::add_option(const std::string& names, Value& value, const Rule& rule, const std::string& help) {
  CLI::Option* option = app_->add_option(names, value, help)->capture_default_str();
  if (option->get_default_str() == "[]") option->default_str("");
  if (rule) rule(*option);
}

template void Command::add_option(const std::string&, double&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, int&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::uint64_t&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::string&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::optional<double>&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::optional<int>&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::vector<double>&, const Rule&, const std::string&);
template void Command::add_option(const std::string&, std::vector<std::string>&, const Rule&, const std::string&);

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

void Command::runs(Run run) {
  app_->callback([&chosen = chosen_, run = std::move(run)] { chosen = run; });
}

namespace {

// The libraries beneath print their own complaints; ours is one line that names the file.
void silence_libraries() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  setenv("GST_DEBUG", "none", 0);
}

// A closed one would give its number to a result's file, and our messages would go there. A limit on files' sizes is an
// error like a full disk, which is reported, and not the end.
void prepare_standard_streams() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(number, F_GETFD) == -1 && ::open("/dev/null", O_RDWR) != number) std::abort();
  std::signal(SIGXFSZ, SIG_IGN);
}

// The printed part may be the wanted one.
int flushed(int exit_code) {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return exit_code;
  std::fprintf(stderr, "lapservo: standard output: could not be written to its end\n");
  return bad_input;
}

int run_subcommand(int argc, char** argv, const std::vector<AddSubcommand>& subcommands) {
  CLI::App app{"See and steer a laparoscopic instrument by its camera.", "lapservo"};
  app.set_version_flag("--version", "lapservo " LAPSERVO_VERSION);
  app.require_subcommand(1);
  app.footer(
      "`lapservo SUBCOMMAND --help` shows its options and an example.\n"
      "Exit codes: 0 done, 1 found nothing or did not converge, 2 bad input.");
  Run run;
  const Command program(&app, run);
  for (const AddSubcommand add : subcommands) add(program);
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

}  // namespace

int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands) {
  silence_libraries();
  prepare_standard_streams();
  try {
    return flushed(run_subcommand(argc, argv, subcommands));
  } catch (const std::filesystem::filesystem_error& error) {
    std::fprintf(stderr, "lapservo: %s: can't be used (%s), expected a name that can\n", error.path1().c_str(),
                 error.code().message().c_str());
    return bad_input;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lapservo: %s\n", error.what());
    return interrupted() ? 1 : bad_input;
  }
}

}  // namespace lapservo::app
