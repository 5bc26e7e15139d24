#pragma once

#include <ceres/ceres.h>

#include "lapservo/calibration/fit/at_iteration.h"

namespace lapservo::internal {

/// Ceres' solver without a word on stderr: what it complains of, its results say. Whether there is a solution to use.
bool solve_quietly(ceres::Solver::Options options, ceres::Problem& problem, ceres::Solver::Summary& summary,
                   const AtIteration& at_iteration);

}  // namespace lapservo::internal
