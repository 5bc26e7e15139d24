#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "lapservo/experiments/parallel.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// Input of every experiment.
struct ExperimentSetup {
  Rig rig;  ///< one instrument, with camera_from_rcm: see single_instrument()
  std::uint64_t seed = 1;
  std::vector<Method> methods{Method::centerline, Method::surface};
  KeepGoing keep_going = [](int, int) { return true; };
  std::string options;  ///< of the command line, for "how to make it again": begins with a space when not empty
};

/// The rig of configs/paper.yaml, on which the paper's trajectory is feasible.
Rig paper_rig();

/// For trackers that must not know where the RCM is.
Rig without_registration(Rig rig);

/// "the paper's method" or "the default".
std::string method_title(Method method);
/// The colour of a method's series in every plot.
int method_colour(Method method);

}  // namespace lapservo::internal
