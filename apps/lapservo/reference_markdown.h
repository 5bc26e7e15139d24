#pragma once

#include <string>

#include "apps/lapservo/command_description.h"

namespace lapservo::app {

/// All commands on one page, a section each, in MyST's Markdown with definition lists.
std::string reference_markdown(const CommandDescription& root);

}  // namespace lapservo::app
