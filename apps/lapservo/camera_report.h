#pragma once

#include <filesystem>
#include <vector>

#include "lapservo/calibration/camera_calibration.h"

namespace lapservo::app {

/// One HTML page about a camera's calibration: where the boards lay, what edges miss the fit by, the response.
void write_camera_report(const std::filesystem::path& path, const Camera& before,
                         const std::vector<internal::BoardView>& views, const internal::CameraCalibration& calibration);

}  // namespace lapservo::app
