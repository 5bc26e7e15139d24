#pragma once

#include <string>

#include "apps/lapservo/command_description.h"

namespace lapservo::app {

/// A manual page of section 1 in roff's man macros. `root`: to name the others, and what exit codes mean.
std::string manual_page(const CommandDescription& command, const CommandDescription& root, const std::string& version);

}  // namespace lapservo::app
