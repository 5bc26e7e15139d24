#pragma once

#include <string>

#include <opencv2/core.hpp>

namespace lapservo::app {

/// The window of --view.
class LiveView {
 public:
  /// Throws InputError when there is no display; `instead` says what the user may do without one.
  LiveView(const std::string& subcommand, const std::string& instead);
  /// False once the user pressed q or Esc.
  bool show(const cv::Mat& picture);

 private:
  std::string title_;
};

}  // namespace lapservo::app
