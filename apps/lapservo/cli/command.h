#pragma once

#include <functional>
#include <utility>

#include <CLI/CLI.hpp>

namespace lapservo::app {

/// The job of a parsed command line; returns the exit code: 0, or 1 when nothing was found or nothing converged. Throws
/// InputError for bad input, which main() prints in one line and ends with 2.
using Run = std::function<int()>;

/// Sets `run_later` when the command line names this subcommand.
inline void runs(CLI::App& command, Run& run_later, Run run) {
  command.callback([&run_later, run = std::move(run)] { run_later = run; });
}

// Checks of an option's numbers: the whole text is one finite number within [low, high]. CLI11 alone takes nan through
// every range, -1 as an enormous unsigned and blanks as nothing.
CLI::Validator number_between(double low, double high);
CLI::Validator whole_number_between(double low, double high);
CLI::Validator finite_number();
/// Any whole number of 53 bits.
CLI::Validator seed_number();

}  // namespace lapservo::app
