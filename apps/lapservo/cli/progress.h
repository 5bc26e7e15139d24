#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace lapservo::app {

/// One line on stderr with the progress of a long job, only on a terminal and only once it takes longer than a second.
class Progress {
 public:
  explicit Progress(std::optional<int> total);
  ~Progress();
  void show(int done, const std::string& remark);
  /// Before another line is printed.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  std::optional<int> total_;
  bool terminal_, shown_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

}  // namespace lapservo::app
