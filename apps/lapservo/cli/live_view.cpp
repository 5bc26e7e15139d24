#include "apps/lapservo/cli/live_view.h"

#include <cstdlib>

#include <opencv2/highgui.hpp>

#include "lapservo/core/error.h"

namespace lapservo::app {

LiveView::LiveView(const std::string& subcommand, const std::string& instead)
    : title_("lapservo " + subcommand + " (q to quit)") {
  if (!std::getenv("DISPLAY") && !std::getenv("WAYLAND_DISPLAY"))
    throw InputError("--view", "needs a display and there is none: " + instead);
}

bool LiveView::show(const cv::Mat& picture) {
  constexpr int escape = 27;
  cv::imshow(title_, picture);
  const int key = cv::waitKey(1) & 0xff;
  return key != 'q' && key != escape;
}

}  // namespace lapservo::app
