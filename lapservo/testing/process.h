#pragma once

#include <csignal>
#include <fcntl.h>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace lapservo::testing {

/// Between blanks.
inline std::vector<std::string> words_of(const std::string& line) {
  std::istringstream from(line);
  return {std::istream_iterator<std::string>(from), {}};
}

/// A program with these arguments, its output in a file; killed with the object, or when this process ends.
class Process {
 public:
  explicit Process(const std::string& program, const std::vector<std::string>& arguments = {},
                   const std::string& output = "/dev/null") {
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    id_ = ::fork();
    if (id_ != 0) return;
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(file, 1);
    ::dup2(file, 2);
    ::execv(argv.front(), argv.data());
    ::_exit(127);
  }
  ~Process() { kill(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const { ::kill(id_, number); }
  void kill() {
    if (running()) signal(SIGKILL), wait();
  }
  bool running() { return !exit_code_ && ::waitpid(id_, &status_, WNOHANG) == 0; }
  /// Its exit code; -1 after a signal.
  int wait() {
    if (!exit_code_) {
      ::waitpid(id_, &status_, 0);
      exit_code_ = WIFEXITED(status_) ? WEXITSTATUS(status_) : -1;
    }
    return *exit_code_;
  }

 private:
  pid_t id_ = 0;
  int status_ = 0;
  std::optional<int> exit_code_;
};

}  // namespace lapservo::testing
