#include "apps/lapservo/cli/program.h"

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fcntl.h>
#include <filesystem>
#include <unistd.h>
#include <vector>

#include <opencv2/core/utils/logger.hpp>

#include "apps/lapservo/cli/interrupt.h"

namespace lapservo::app {
namespace {

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

}  // namespace

int run_program(int argc, char** argv, const std::vector<AddSubcommand>& subcommands) {
  silence_libraries();
  prepare_standard_streams();
  try {
    return flushed(run_subcommand(argc, argv, LAPSERVO_VERSION, subcommands));
  } catch (const std::filesystem::filesystem_error& error) {
    std::fprintf(stderr, "lapservo: %s: can't be used (%s), expected a name that can\n", error.path1().c_str(),
                 error.code().message().c_str());
    return bad_input;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lapservo: %s\n", error.what());
    return interrupted() ? 1 : bad_input;
  }
}

}  // namespace lapservo::app
