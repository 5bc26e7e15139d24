#include "lapservo/calibration/solve_quietly.h"

#include <glog/logging.h>

namespace lapservo::internal {

bool solve_quietly(ceres::Solver::Options options, ceres::Problem& problem, ceres::Solver::Summary& summary) {
  FLAGS_minloglevel = google::GLOG_FATAL;
  options.logging_type = ceres::SILENT;
  ceres::Solve(options, &problem, &summary);
  return summary.IsSolutionUsable();
}

}  // namespace lapservo::internal
