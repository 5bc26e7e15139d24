#include "apps/lapservo/command_description.h"

#include <sstream>

namespace lapservo::app {
namespace {

// CLI11 keeps a set's members only in the text that help shows: TEXT:{one,two}.
std::vector<std::string> choices_in(const std::string& type) {
  const auto open = type.find(":{");
  if (open == std::string::npos || type.back() != '}') return {};
  std::vector<std::string> choices;
  std::istringstream members(type.substr(open + 2, type.size() - open - 3));
  for (std::string member; std::getline(members, member, ',');) choices.push_back(member);
  return choices;
}

// CLI11 names the type of a range twice: INT:INT in [0 - 100].
std::string without_repetition(const std::string& type) {
  const auto colon = type.find(':');
  const bool repeated = colon != std::string::npos && type.compare(colon + 1, colon, type, 0, colon) == 0;
  return repeated ? type.substr(colon + 1) : type;
}

OptionDescription describe_option(const CLI::Option& option) {
  OptionDescription result;
  result.positional = option.get_positional();
  if (result.positional) {
    result.names.push_back(option.get_name(true));
  } else {
    for (const std::string& name : option.get_snames()) result.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) result.names.push_back("--" + name);
  }
  result.required = option.get_required();
  result.takes_value = option.get_items_expected_max() > 0;
  result.value_optional = result.takes_value && option.get_items_expected_min() == 0;
  if (result.takes_value) {
    result.choices = choices_in(option.get_type_name());
    result.type = result.choices.empty() ? without_repetition(option.get_type_name()) : "TEXT";
    result.default_value = option.get_default_str();
  }
  result.description = option.get_description();
  return result;
}

bool is_shown(const CLI::App* app) {
  return !app->get_group().empty();
}

CommandDescription describe(const CLI::App& app, std::vector<std::string> words) {
  words.push_back(app.get_name());
  CommandDescription result{words, app.get_description(), app.get_footer(), {}, {}};
  for (const CLI::Option* option : app.get_options())
    if (!option->get_group().empty()) result.options.push_back(describe_option(*option));
  for (const CLI::App* subcommand : app.get_subcommands(is_shown))
    result.subcommands.push_back(describe(*subcommand, words));
  return result;
}

}  // namespace

std::string CommandDescription::name(char separator) const {
  std::string result;
  for (const std::string& word : words) result += (result.empty() ? "" : std::string(1, separator)) + word;
  return result;
}

CommandDescription describe_command(const CLI::App& app) {
  return describe(app, {});
}

std::vector<const CommandDescription*> all_commands(const CommandDescription& root) {
  std::vector<const CommandDescription*> result{&root};
  for (const CommandDescription& subcommand : root.subcommands)
    for (const CommandDescription* command : all_commands(subcommand)) result.push_back(command);
  return result;
}

FooterParts footer_parts(const std::string& footer) {
  FooterParts parts;
  bool in_examples = false;
  std::istringstream lines(footer);
  for (std::string line; std::getline(lines, line);) {
    if (line == "Example:" || line == "Examples:")
      in_examples = true;
    else
      (in_examples ? parts.examples : parts.text).push_back(line);
  }
  return parts;
}

}  // namespace lapservo::app
