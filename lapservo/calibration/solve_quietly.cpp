#include "lapservo/calibration/solve_quietly.h"

#include <exception>
#include <glog/logging.h>

#include "lapservo/calibration/asked_while_fitting.h"

namespace lapservo::internal {
namespace {

// Ceres need not know of exceptions.
class Asking : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    try {
      AskedWhileFitting::ask();
    } catch (...) {
      thrown = std::current_exception();
      return ceres::SOLVER_ABORT;
    }
    return ceres::SOLVER_CONTINUE;
  }
  std::exception_ptr thrown;
};

}  // namespace

bool solve_quietly(ceres::Solver::Options options, ceres::Problem& problem, ceres::Solver::Summary& summary) {
  [[maybe_unused]] static const int quiet = FLAGS_minloglevel = google::GLOG_FATAL;  // once: fits run side by side
  options.logging_type = ceres::SILENT;
  Asking asking;
  options.callbacks.push_back(&asking);
  ceres::Solve(options, &problem, &summary);
  if (asking.thrown) std::rethrow_exception(asking.thrown);
  return summary.IsSolutionUsable();
}

}  // namespace lapservo::internal
