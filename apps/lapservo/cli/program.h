#pragma once

#include <vector>

#include "apps/lapservo/cli/command.h"

namespace lapservo::app {

/// One of subcommands.h.
using AddSubcommand = void (*)(Command app, Run& run);

/// Parses the command line, runs the subcommand that it names, and returns the exit code. Errors are one line on
/// stderr.
int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands);

}  // namespace lapservo::app
