#pragma once

#include <string>

namespace lapservo::internal {

/// A number of the rig that was measured, in the unit that its name ends in; sigma: one standard deviation.
struct CalibratedNumber {
  std::string name;
  double before, after, sigma;
};

}  // namespace lapservo::internal
