#include "cameras/camera.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {

std::unique_ptr<LiveCamera> open_camera(const std::string& camera, const cv::Size&, CameraSink) {
  throw InputError(camera,
                   "is a camera, which this build can't read: it was built without libgstreamer1.0-dev and "
                   "libgstreamer-plugins-base1.0-dev");
}

}  // namespace lapservo::internal
