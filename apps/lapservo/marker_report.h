#pragma once

#include <filesystem>

#include "lapservo/calibration/marker_calibration.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {

/// One HTML page: what each boundary misses the print by over the turn, for the rig's print and for the calibrated one,
/// and both prints unrolled. Throws InputError when it can't be written.
void write_marker_report(const std::filesystem::path& path, const Instrument& instrument,
                         const internal::MarkerCalibration& calibration);

}  // namespace lapservo::app
