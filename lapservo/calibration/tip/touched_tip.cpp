#include <algorithm>

#include <fmt/format.h>

#include "lapservo/calibration/tip/tip_ways.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr double touch_sigma_m = 0.1e-3;

std::vector<TipFault> possible_faults(const std::vector<TipSighting>& touches) {
  const auto count = static_cast<Eigen::Index>(touches.size());
  TipFault drift{"the board moves over the touches", "fasten it and the endoscope, and begin anew", {}};
  for (Eigen::Index i = 0; i < 3; ++i)
    drift.moves.emplace_back(Eigen::Vector3d::Unit(i) * Eigen::RowVectorXd::LinSpaced(count, -0.5, 0.5));
  Eigen::Matrix3Xd points(3, count);
  for (Eigen::Index i = 0; i < count; ++i) points.col(i) = *touches[static_cast<std::size_t>(i)].point_in_camera_m;
  points /= points.rowwise().mean().norm();
  return {drift,
          {"the board is nearer or farther than the marker has it",
           "measure its squares and the marker's diameter with callipers",
           {points}}};
}

}  // namespace

TipCalibration touched_tip(const Tool& tool, const std::vector<TipSighting>& touches,
                           const std::vector<std::string>& names) {
  constexpr double outlying = 8, least_outlying_m = 0.5e-3;
  TipCalibration result;
  if (touches.size() < least_touches)
    return result.refusal = fmt::format("{} touches show the marker, {} are needed", touches.size(), least_touches),
           result;
  result = fit_tip(tool, touches,
                   {possible_faults(touches), touch_sigma_m, 1, 1,
                    "is the wrist loose (hold it with its motors on), are the corners the ones that are named",
                    "touch more corners, the shaft tilted and rolled differently"});
  if (result.misses_m.empty()) return result;
  const auto worst = std::max_element(result.misses_m.begin(), result.misses_m.end());
  const double usual_m = median(std::vector<double>(result.misses_m));
  if (*worst > std::max(least_outlying_m, outlying * usual_m))
    result.refusal = fmt::format(
        "{}: the tip is {:.2g} mm from its corner, in most touches {:.2g} mm: is the corner the one that is named, is "
        "the tip on it",
        names[static_cast<std::size_t>(worst - result.misses_m.begin())], 1e3 * *worst, 1e3 * usual_m);
  return result;
}

}  // namespace lapservo::internal
