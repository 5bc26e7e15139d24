#pragma once

#include <vector>

#include "apps/lapservo/cli/command.h"

namespace lapservo::app {

/// The whole program: see run_subcommand(). Errors of any kind are one line on stderr, and exit code 2.
int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands);

}  // namespace lapservo::app
