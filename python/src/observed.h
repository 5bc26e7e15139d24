#pragma once
#include <memory>
#include <optional>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo::python {

/// An observation with the rig that it is of, which drawing and the RCM's image need.
struct Observed {
  Observation observation;
  std::shared_ptr<const Rig> rig;
  std::optional<double> stamp_s;
};

std::vector<Observed> observed(const std::vector<Observation>& observations, const std::shared_ptr<const Rig>& rig,
                               std::optional<double> stamp_s);

}  // namespace lapservo::python
