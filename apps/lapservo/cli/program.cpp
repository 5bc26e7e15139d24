#include "apps/lapservo/cli/program.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <string>
#include <unistd.h>
#include <vector>

#include <CLI/CLI.hpp>
#include <opencv2/core/utils/logger.hpp>

#include "lapservo/core/error.h"
#include "lapservo/core/nearest_word.h"

namespace lapservo::app {
namespace {

constexpr int bad_input = 2;

// The libraries beneath print their own complaints; ours is one line that names the file.
void silence_libraries() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  setenv("GST_DEBUG", "none", 0);
}

// A closed one would give its number to a result's file, and our messages would go there. A limit on files' sizes is an
// error like a full disk, which is reported, and not the end.
void prepare_standard_streams() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(number, F_GETFD) == -1 && ::open("/dev/null", O_RDWR) != number) std::abort();
  std::signal(SIGXFSZ, SIG_IGN);
}

// The printed part may be the wanted one.
int flushed(int exit_code) {
  if (std::fflush(stdout) == 0 && !std::ferror(stdout)) return exit_code;
  std::fprintf(stderr, "lapservo: standard output: could not be written to its end\n");
  return bad_input;
}

// The first word of a command line that is no command or option, with the nearest that is one: "; trak is unknown, the
// nearest is track"; empty where all are known.
std::string suggestion(const CLI::App& program, int argc, char** argv) {
  const CLI::App* command = &program;
  for (int i = 1; i < argc; ++i) {
    const std::string word = std::string(argv[i]).substr(0, std::string(argv[i]).find('='));
    std::vector<std::string> known;
    if (word.starts_with("--")) {
      for (const CLI::Option* option : command->get_options())
        for (const std::string& name : option->get_lnames()) known.push_back("--" + name);
    } else if (command->get_require_subcommand_min() > 0) {
      for (const CLI::App* subcommand : command->get_subcommands([](const CLI::App*) { return true; }))
        known.push_back(subcommand->get_name());
    }
    if (known.empty()) continue;
    if (std::find(known.begin(), known.end(), word) == known.end())
      return "; " + word + " is unknown, the nearest is " + internal::nearest_word(word, known);
    if (!word.starts_with("--")) command = command->get_subcommand(word);
  }
  return "";
}

int parse_and_run(int argc, char** argv, const std::vector<AddSubcommand>& subcommands) {
  CLI::App app{"See and steer a laparoscopic instrument by its camera.", "lapservo"};
  app.set_version_flag("--version", "lapservo " LAPSERVO_VERSION);
  app.require_subcommand(1);
  app.footer(
      "`lapservo SUBCOMMAND --help` shows its options and an example.\n"
      "Exit codes: 0 done, 1 found nothing or did not converge, 2 bad input.");
  Run run;
  for (const AddSubcommand add : subcommands) add(Command(&app), run);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    std::fprintf(stderr, "lapservo: %s%s (try --help)\n", error.what(), suggestion(app, argc, argv).c_str());
    return bad_input;
  }
  return run();
}

}  // namespace

int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands) {
  silence_libraries();
  prepare_standard_streams();
  try {
    return flushed(parse_and_run(argc, argv, subcommands));
  } catch (const std::filesystem::filesystem_error& error) {
    std::fprintf(stderr, "lapservo: %s: can't be used (%s), expected a name that can\n", error.path1().c_str(),
                 error.code().message().c_str());
    return bad_input;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lapservo: %s\n", error.what());
    return bad_input;
  }
}

}  // namespace lapservo::app
