#pragma once

#include <filesystem>
#include <vector>

#include "apps/lapservo/calibrated_number.h"
#include "lapservo/calibration/registration.h"

namespace lapservo::app {

/// What a registration measured, in mm, mrad and ms; `before` is NaN where the rig had nothing.
std::vector<CalibratedNumber> registered_numbers(const Instrument& before, const internal::Registration& registration);

/// One HTML page: what is left at each frame over time, and the numbers. Throws InputError when it can't be written.
void write_registration_report(const std::filesystem::path& path, const Instrument& instrument,
                               const internal::Registration& registration);

}  // namespace lapservo::app
