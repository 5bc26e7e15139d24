#pragma once

#include <string>

namespace lapservo::internal {

/// A standard deviation to three digits: the last digits of an estimated covariance differ from run to run.
double rounded_sigma(double sigma);

/// The same, as files hold it.
std::string sigma_text(double sigma);

}  // namespace lapservo::internal
