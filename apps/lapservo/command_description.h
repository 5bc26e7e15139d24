#pragma once

#include <string>
#include <vector>

#include <CLI/App.hpp>

namespace lapservo::app {

struct OptionDescription {
  std::vector<std::string> names;  ///< "--rig"; a positional's one name
  bool positional = false, required = false, takes_value = false, value_optional = false;
  std::string type;  ///< "TEXT", "FLOAT:0.1 to 10"; empty without a value
  /// As a page says it: "[INT]" where it may be left out.
  std::string type_shown() const { return value_optional ? "[" + type + "]" : type; }
  std::vector<std::string> choices;
  std::string default_value;  ///< empty: none
  std::string description;

  bool takes_file_or_text() const { return takes_value && choices.empty() && type == "TEXT"; }
};

/// A command as its parser has it, for pages and completion that are written from it.
struct CommandDescription {
  std::vector<std::string> words;  ///< {"lapservo", "calibrate", "marker"}
  std::string description, footer;
  std::vector<OptionDescription> options;
  std::vector<CommandDescription> subcommands;

  std::string name(char separator = ' ') const;
};

/// Without what help doesn't show either.
CommandDescription describe_command(const CLI::App& app);

/// The command, then all below it.
std::vector<const CommandDescription*> all_commands(const CommandDescription& root);

/// A footer's text before the line "Example:" or "Examples:", and the lines after it.
struct FooterParts {
  std::vector<std::string> text, examples;
};
FooterParts footer_parts(const std::string& footer);

}  // namespace lapservo::app
