#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lapservo::app {

/// The job of a parsed command line; returns the exit code: 0, or 1 when nothing was found or nothing converged. Throws
/// InputError for bad input, which run_program() prints in one line and ends with 2.
using Run = std::function<int()>;

// CLI11 reads the command line; its headers, which take seconds to compile, stay in command.cpp.

/// A condition of an option's value; empty: none.
using Rule = std::function<void(CLI::Option& option)>;
/// It must be given, and `rule` holds too.
Rule required(const Rule& rule = {});
/// The option alone means this; `rule` holds for any other value.
Rule without_value(const std::string& meant, const Rule& rule);
Rule one_of(const std::vector<std::string>& words);
// For numbers: the whole text is one finite number within [low, high], whole where the rule says so. CLI11 alone takes
// nan through every range, -1 as an enormous unsigned and blanks as nothing.
Rule between(double low, double high);
Rule whole_between(double low, double high);
/// So many, with commas between them.
Rule finite_numbers(std::optional<int> count = std::nullopt);
/// Any whole number of 53 bits.
Rule seed_number();

/// The program, or a subcommand of it.
class Command {
 public:
  /// `chosen` becomes the job of the subcommand that the command line names.
  Command(CLI::App* app, Run& chosen) : app_(app), chosen_(chosen) {}

  Command add_subcommand(const std::string& name, const std::string& about);
  /// One with options of its own, to be filled by add_option(). `job` takes these, or these and its Command.
  template <typename Options, typename Job>
  std::pair<Command, Options&> add_subcommand(const std::string& name, const std::string& about, Job job) {
    const auto options = std::make_shared<Options>();
    Command command = add_subcommand(name, about);
    command.runs([=] {
      if constexpr (std::is_invocable_v<Job, const Options&, const Command&>)
        return job(*options, command);
      else
        return job(*options);
    });
    return {command, *options};
  }
  void require_subcommand();
  /// Value: double, int, std::uint64_t, std::string, and optionals and vectors as command.cpp has them. It must live
  /// until the command line is parsed; --help shows what it is without being given.
  template <typename Value>
  void add_option(const std::string& names, Value& value, const Rule& rule, const std::string& help);
  template <typename Value>
  void add_option(const std::string& names, Value& value, const std::string& help) {
    add_option(names, value, Rule(), help);
  }
  void add_flag(const std::string& names, bool& value, const std::string& help);
  /// The end of --help: an example.
  void footer(const std::string& text);
  /// The options that the command line gives, as "--rig"; after it was parsed.
  std::vector<std::string> given() const;
  /// Throws InputError with `why` where it gives one of these, which would be ignored.
  void refuse(const std::vector<std::string>& names, const std::string& why) const;

 private:
  void runs(Run run);

  CLI::App* app_;
  Run& chosen_;
};

/// Adds a subcommand (subcommands.h).
using AddSubcommand = void (*)(Command app);

/// The whole program: parses the command line, and runs the subcommand that it names. Returns the exit code. Errors of
/// any kind are one line on stderr, and exit code 2.
int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands);

}  // namespace lapservo::app
