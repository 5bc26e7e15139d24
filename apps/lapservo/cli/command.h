#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace lapservo::app {

/// The job of a parsed command line; returns the exit code: 0, or 1 when nothing was found or nothing converged. Throws
/// InputError for bad input, which main() prints in one line and ends with 2.
using Run = std::function<int()>;
inline constexpr int bad_input = 2;

// CLI11 reads the command line; its headers, which take seconds to compile, stay in command.cpp.

/// An option of a subcommand.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option& required();
  /// The option alone means this.
  Option& without_value(const std::string& meant);
  Option& one_of(const std::vector<std::string>& words);

  // For numbers: the whole text is one finite number within [low, high], whole where the option's is. CLI11 alone takes
  // nan through every range, -1 as an enormous unsigned and blanks as nothing.
  Option& number_between(double low, double high);
  Option& whole_number_between(double low, double high);
  /// So many, with commas between them.
  Option& finite_numbers(std::optional<int> count = std::nullopt);
  /// Any whole number of 53 bits.
  Option& seed_number();

 private:
  CLI::Option* option_;
};

/// The program, or a subcommand of it.
class Command {
 public:
  explicit Command(CLI::App* app) : app_(app) {}

  Command add_subcommand(const std::string& name, const std::string& about);
  void require_subcommand();
  /// Value: double, int, std::uint64_t, std::string, and optionals and vectors as command.cpp has them. It must live
  /// until the command line is parsed; --help shows what it is without being given.
  template <typename Value>
  Option add_option(const std::string& names, Value& value, const std::string& help);
  void add_flag(const std::string& names, bool& value, const std::string& help);
  /// The end of --help: an example.
  void footer(const std::string& text);
  /// The options that the command line gives, as "--rig"; after it was parsed.
  std::vector<std::string> given() const;
  /// Throws InputError with `why` where it gives one of these, which would be ignored.
  void refuse(const std::vector<std::string>& names, const std::string& why) const;
  /// Sets `run_later` when the command line names this subcommand.
  void runs(Run& run_later, Run run);

 private:
  CLI::App* app_;
};

/// Adds a subcommand (subcommands.h); `run` is set when the command line names it.
using AddSubcommand = void (*)(Command app, Run& run);

/// Parses the command line, and runs the subcommand that it names. Returns the exit code: errors of the command line
/// are one line on stderr, and 2.
int run_subcommand(int argc, char** argv, const std::string& version, const std::vector<AddSubcommand>& subcommands);

}  // namespace lapservo::app
