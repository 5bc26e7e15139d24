#include "cameras/camera.h"

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <sstream>
#include <string_view>
#include <system_error>

namespace lapservo::internal {
namespace {

constexpr std::string_view pipeline = "gst:", device = "/dev/video", by_name = "/dev/v4l/";

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 4 && text.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

bool names_camera(const std::string& text) {
  if (text.starts_with(pipeline) || text.starts_with(device) || text.starts_with(by_name)) return true;
  std::error_code error;
  return is_number(text) && !std::filesystem::exists(text, error);
}

std::string camera_pipeline(const std::string& camera, const cv::Size& size) {
  if (camera.starts_with(pipeline)) return camera.substr(pipeline.size());
  const std::string path = is_number(camera) ? std::string(device) + camera : camera;
  std::string sized;
  if (!size.empty()) sized = ",width=" + std::to_string(size.width) + ",height=" + std::to_string(size.height);
  std::ostringstream text;
  text << "v4l2src device=" << std::quoted(path) << " ! capsfilter caps=\"video/x-raw" << sized
       << ",framerate=[25/1,1000/1];image/jpeg" << sized << ";video/x-raw" << sized << "\" ! decodebin";
  return text.str();
}

}  // namespace lapservo::internal
