#pragma once

#include <filesystem>

#include "lapservo/calibration/registration.h"

namespace lapservo::app {

/// One HTML page: what is left at each frame over time, and the numbers. Throws InputError when it can't be written.
void write_registration_report(const std::filesystem::path& path, const Instrument& instrument,
                               const internal::Registration& registration);

}  // namespace lapservo::app
