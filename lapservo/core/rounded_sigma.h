#pragma once

#include <string>

namespace lapservo::internal {

/// A standard deviation to three digits: the last digits of an estimated covariance differ from run to run.
double rounded_sigma(double sigma);

/// A measured value to less than a thousandth of its sigma: the digits below differ from run to run. As it is where the
/// sigma is none.
double rounded_by_sigma(double value, double sigma);

/// rounded_sigma(), as files hold it.
std::string sigma_text(double sigma);

}  // namespace lapservo::internal
