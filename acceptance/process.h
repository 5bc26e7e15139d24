#pragma once

#include <csignal>
#include <fcntl.h>
#include <optional>
#include <string>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

namespace lapservo::acceptance {

/// A program with these arguments, its output in a file; killed with the object.
class Process {
 public:
  Process(const std::string& program, const std::vector<std::string>& arguments, const std::string& output) {
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    id_ = ::fork();
    if (id_ != 0) return;
    const int file = ::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(file, 1);
    ::dup2(file, 2);
    ::execv(argv.front(), argv.data());
    ::_exit(127);
  }
  ~Process() {
    if (running()) signal(SIGKILL), wait();
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void signal(int number) const { ::kill(id_, number); }
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

}  // namespace lapservo::acceptance
