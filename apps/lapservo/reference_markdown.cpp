#include "apps/lapservo/reference_markdown.h"

#include <vector>

namespace lapservo::app {
namespace {

// Text that Markdown takes for text, but for what stands in backticks already.
std::string in_markdown(const std::string& text) {
  std::string result;
  bool code = false;
  for (const char c : text) {
    if (c == '`') code = !code;
    if (!code && std::string("\\*_[]<>{}$~#|").find(c) != std::string::npos) result += '\\';
    result += c;
  }
  return result;
}

std::string markdown_entry(const OptionDescription& option) {
  std::string entry;
  for (const std::string& name : option.names) entry += (entry.empty() ? "`" : ", `") + name + "`";
  if (!option.positional && option.takes_value && option.choices.empty())
    entry += " *" + in_markdown(option.type_shown()) + "*";
  if (option.required) entry += ", required";
  entry += "\n: " + in_markdown(option.description);
  std::string notes;
  for (const std::string& choice : option.choices) notes += (notes.empty() ? "One of `" : ", `") + choice + "`";
  if (!option.default_value.empty())
    notes += (notes.empty() ? "Default: `" : "; default `") + option.default_value + "`";
  if (!notes.empty()) entry += "\\\n  " + notes;
  return entry + "\n\n";
}

std::string code_block(const std::vector<std::string>& lines) {
  std::string block = "```text\n";
  for (const std::string& line : lines) block += line + "\n";
  return block + "```\n\n";
}

std::string section(const CommandDescription& command) {
  std::string text = std::string(command.words.size() < 3 ? "## " : "### ") + command.name() + "\n\n" +
                     in_markdown(command.description) + "\n\n";
  for (const OptionDescription& option : command.options)
    if (option.positional) text += markdown_entry(option);
  for (const OptionDescription& option : command.options)
    if (!option.positional && option.names.back() != "--help") text += markdown_entry(option);
  const FooterParts footer = footer_parts(command.footer);
  for (const std::string& line : footer.text) text += in_markdown(line) + "\n";
  text += "\n";
  if (!footer.examples.empty()) text += code_block(footer.examples);
  return text;
}

}  // namespace

std::string reference_markdown(const CommandDescription& root) {
  std::string page =
      "# The command line\n\nWritten from the options that the program parses; `--help` of each command and its manual "
      "page say the same.\n\n";
  for (const CommandDescription* command : all_commands(root)) page += section(*command);
  return page;
}

}  // namespace lapservo::app
