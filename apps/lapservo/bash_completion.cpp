#include "apps/lapservo/bash_completion.h"

#include <vector>

namespace lapservo::app {
namespace {

std::string joined(const std::vector<std::string>& words) {
  std::string result;
  for (const std::string& word : words) result += (result.empty() ? "" : " ") + word;
  return result;
}

std::string in_quotes(const std::string& text) {
  return "'" + text + "'";  // names of commands and options, and their choices, hold no quotes
}

std::vector<std::string> option_names(const CommandDescription& command) {
  std::vector<std::string> names;
  for (const OptionDescription& option : command.options)
    if (!option.positional) names.insert(names.end(), option.names.begin(), option.names.end());
  return names;
}

// What may stand where no option does: subcommands, or the words that a positional takes.
std::vector<std::string> plain_words(const CommandDescription& command) {
  std::vector<std::string> words;
  for (const CommandDescription& sub : command.subcommands) words.push_back(sub.words.back());
  for (const OptionDescription& option : command.options)
    if (option.positional) words.insert(words.end(), option.choices.begin(), option.choices.end());
  return words;
}

bool takes_files(const CommandDescription& command) {
  for (const OptionDescription& option : command.options)
    if (option.positional && option.takes_file_or_text()) return true;
  return false;
}

std::string command_case(const CommandDescription& command) {
  return "    " + in_quotes(command.name()) + ")\n      options=" + in_quotes(joined(option_names(command))) +
         " words=" + in_quotes(joined(plain_words(command))) + " files=" + (takes_files(command) ? "1" : "") + " ;;\n";
}

std::string value_case(const CommandDescription& command, const OptionDescription& option) {
  std::string patterns;
  for (const std::string& name : option.names)
    patterns += (patterns.empty() ? "" : "|") + in_quotes(command.name() + " " + name);
  return "    " + patterns + ")\n      value=1 words=" + in_quotes(joined(option.choices)) +
         " files=" + (option.takes_file_or_text() ? "1" : "") + " ;;\n";
}

}  // namespace

std::string bash_completion(const CommandDescription& root) {
  std::string names, commands, values;
  for (const CommandDescription* command : all_commands(root)) {
    if (command != &root) names += (names.empty() ? "" : "|") + in_quotes(command->name());
    commands += command_case(*command);
    for (const OptionDescription& option : command->options)
      if (!option.positional && option.takes_value) values += value_case(*command, option);
  }
  return R"(# Written by `lapservo reference` from the options that the program parses.
_lapservo() {
  local current=${COMP_WORDS[COMP_CWORD]} before=$((COMP_CWORD - 1)) command=lapservo options= words= files= value= i
  if [[ $current == = ]]; then
    current=
  elif [[ ${COMP_WORDS[before]} == = ]]; then
    before=$((before - 1))
  fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "$command ${COMP_WORDS[i]}" in
      )" +
         names +
         R"() command+=" ${COMP_WORDS[i]}" ;;
    esac
  done
  case $command in
)" + commands +
         R"(  esac
  case "$command ${COMP_WORDS[before]}" in
)" + values +
         R"(  esac
  if [[ $current == -* && -z $value ]]; then
    mapfile -t COMPREPLY < <(compgen -W "$options" -- "$current")
    return
  fi
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
  if [[ $files ]]; then
    compopt -o default 2>/dev/null
  fi
}
complete -F _lapservo lapservo
)";
}

}  // namespace lapservo::app
