#include "apps/lapservo/cli/progress.h"

#include <cstdio>
#include <unistd.h>

#include <fmt/format.h>

namespace lapservo::app {

Progress::Progress(std::optional<int> total) : total_(total), terminal_(::isatty(STDERR_FILENO) != 0) {}

Progress::~Progress() {
  clear();
}

void Progress::clear() {
  if (shown_) std::fputs("\r\033[K", stderr);
  shown_ = false;
}

void Progress::show(int done, const std::string& remark) {
  using namespace std::chrono_literals;
  const auto now = Clock::now();
  if (!terminal_ || now - start_ < 1s || now - last_ < 100ms) return;
  last_ = now;
  shown_ = true;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  std::string line = fmt::format("\r\033[K{}", done);
  if (total_) line += fmt::format("/{}", *total_);
  line += fmt::format(" frames, {:.0f}/s", done / elapsed_s);
  if (total_ && done > 0) line += fmt::format(", {:.0f} s left", elapsed_s / done * (*total_ - done));
  line += remark;
  std::fputs(line.c_str(), stderr);
  std::fflush(stderr);
}

}  // namespace lapservo::app
