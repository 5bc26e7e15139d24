#pragma once

#include <ceres/ceres.h>

namespace lapservo::internal {

/// Ceres' solver without a word on stderr: what it complains of, its results say. Whether there is a solution to use.
/// Calls AskedWhileFitting::ask() at each iteration, and throws what that throws.
bool solve_quietly(ceres::Solver::Options options, ceres::Problem& problem, ceres::Solver::Summary& summary);

}  // namespace lapservo::internal
