#pragma once

#include <string>

#include "apps/lapservo/command_description.h"

namespace lapservo::app {

/// A script for bash: subcommands, options, the words that an option takes; files where it takes text.
std::string bash_completion(const CommandDescription& root);

}  // namespace lapservo::app
