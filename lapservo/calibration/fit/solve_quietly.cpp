#include "lapservo/calibration/fit/solve_quietly.h"

#include <exception>
#include <glog/logging.h>

namespace lapservo::internal {
namespace {

// Ceres need not know of exceptions.
class Calling : public ceres::IterationCallback {
 public:
  explicit Calling(const AtIteration& at_iteration) : at_iteration_(at_iteration) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    try {
      at_iteration_();
    } catch (...) {
      thrown = std::current_exception();
      return ceres::SOLVER_ABORT;
    }
    return ceres::SOLVER_CONTINUE;
  }
  std::exception_ptr thrown;

 private:
  const AtIteration& at_iteration_;
};

}  // namespace

bool solve_quietly(ceres::Solver::Options options, ceres::Problem& problem, ceres::Solver::Summary& summary,
                   const AtIteration& at_iteration) {
  [[maybe_unused]] static const int quiet = FLAGS_minloglevel = google::GLOG_FATAL;  // once: fits run side by side
  options.logging_type = ceres::SILENT;
  Calling calling(at_iteration);
  if (at_iteration) options.callbacks.push_back(&calling);
  ceres::Solve(options, &problem, &summary);
  if (calling.thrown) std::rethrow_exception(calling.thrown);
  return summary.IsSolutionUsable();
}

}  // namespace lapservo::internal
