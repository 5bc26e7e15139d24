#include "apps/lapservo/manual_page.h"

#include <algorithm>
#include <cctype>
#include <vector>

namespace lapservo::app {
namespace {

// Text that roff takes for text.
std::string in_roff(const std::string& text) {
  std::string result;
  if (!text.empty() && (text[0] == '.' || text[0] == '\'')) result = "\\&";
  for (const char c : text) {
    if (c == '\\')
      result += "\\e";
    else if (c == '-')
      result += "\\-";
    else
      result += c;
  }
  return result;
}

std::string upper_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

// "Tell whether a rig is good enough." as manual pages list it: no capital, no full stop.
std::string brief(std::string text) {
  if (text.ends_with('.')) text.pop_back();
  if (text.size() > 1 && std::islower(static_cast<unsigned char>(text[1])))
    text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return text;
}

std::string bold(const std::string& text) {
  return "\\fB" + in_roff(text) + "\\fR";
}

std::string roff_entry(const OptionDescription& option) {
  std::string names;
  for (const std::string& name : option.names)
    names += (names.empty() ? "" : ", ") + (option.positional ? "\\fI" + in_roff(name) + "\\fR" : bold(name));
  if (!option.positional && option.takes_value) names += " \\fI" + in_roff(option.type_shown()) + "\\fR";
  std::string notes;
  for (const std::string& choice : option.choices) notes += (notes.empty() ? "One of " : ", ") + bold(choice);
  if (!notes.empty()) notes += ". ";
  if (option.required) notes += "Required. ";
  if (!option.default_value.empty()) notes += "Default: " + bold(option.default_value) + ".";
  std::string entry = ".TP\n" + names + "\n" + in_roff(option.description) + "\n";
  if (!notes.empty()) entry += ".br\n" + notes + "\n";
  return entry;
}

std::string options_section(const CommandDescription& command, bool positional) {
  std::string entries;
  for (const OptionDescription& option : command.options)
    if (option.positional == positional) entries += roff_entry(option);
  if (entries.empty()) return {};
  return std::string(".SH ") + (positional ? "ARGUMENTS" : "OPTIONS") + "\n" + entries;
}

std::string synopsis(const CommandDescription& command) {
  std::string line = bold(command.name()) + " [\\fIoptions\\fR]";
  for (const OptionDescription& option : command.options)
    if (option.positional) line += " \\fI" + in_roff(option.names.front()) + "\\fR";
  if (!command.subcommands.empty()) line += " \\fIcommand\\fR ...";
  return ".SH SYNOPSIS\n" + line + "\n";
}

std::string commands_section(const CommandDescription& command) {
  if (command.subcommands.empty()) return {};
  std::string section = ".SH COMMANDS\n";
  for (const CommandDescription& sub : command.subcommands)
    section += ".TP\n\\fB" + in_roff(sub.name('-')) + "\\fR(1)\n" + in_roff(sub.description) + "\n";
  return section;
}

std::string lines_as_they_are(const std::vector<std::string>& lines) {
  std::string text = ".nf\n";
  for (const std::string& line : lines) text += in_roff(line) + "\n";
  return text + ".fi\n";
}

std::string see_also(const CommandDescription& command, const CommandDescription& root) {
  std::string names;
  for (const CommandDescription* other : all_commands(root))
    if (other != &command) names += (names.empty() ? ".BR " : ",\n.BR ") + in_roff(other->name('-')) + " (1)";
  return ".SH SEE ALSO\n" + names + "\n";
}

}  // namespace

std::string manual_page(const CommandDescription& command, const CommandDescription& root, const std::string& version) {
  const FooterParts footer = footer_parts(command.footer);
  std::string page = ".\\\" Written by `lapservo reference` from the options that the program parses.\n";
  page += ".TH \"" + in_roff(upper_case(command.name('-'))) + "\" 1 \"\" \"lapservo " + in_roff(version) +
          "\" \"User Commands\"\n";
  page += ".SH NAME\n" + in_roff(command.name('-')) + " \\- " + in_roff(brief(command.description)) + "\n";
  page += synopsis(command);
  page += ".SH DESCRIPTION\n" + in_roff(command.description) + "\n";
  if (&command != &root && !footer.text.empty()) page += ".PP\n" + lines_as_they_are(footer.text);
  page += commands_section(command);
  page += options_section(command, true);
  page += options_section(command, false);
  if (!footer.examples.empty()) page += ".SH EXAMPLES\n" + lines_as_they_are(footer.examples);
  page += ".SH EXIT STATUS\n0 done, 1 found nothing or did not converge, 2 bad input.\n";
  return page + see_also(command, root);
}

}  // namespace lapservo::app
