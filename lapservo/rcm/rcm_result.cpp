#include "lapservo/rcm/rcm_result.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/rcm/pairwise_mean.h"
#include "lapservo/rcm/projected_rcm.h"

namespace lapservo::internal {
namespace {

RcmResult weighted_result(const std::vector<LineObservation>& lines, double sigma_px, double common_px) {
  const bool known = sigma_px > 0;
  const RcmEstimate estimate =
      estimate_projected_rcm(lines, {known ? NoiseScale::known : NoiseScale::estimated, common_px});
  RcmResult result;
  result.method = "weighted";
  result.status = to_string(estimate.status);
  result.lines = estimate.lines, result.outliers = estimate.outliers;
  if (estimate.status != RcmStatus::ok) return result;
  result.point_px = estimate.point_px;
  result.covariance_px2 = estimate.covariance_px2;
  result.chi2 = known ? std::optional(estimate.chi2) : std::nullopt;
  if (estimate.degrees_of_freedom > 0)
    result.noise_px = (known ? sigma_px : 1) * std::sqrt(estimate.chi2 / estimate.degrees_of_freedom);
  result.spread_rad = estimate.direction_spread_rad;
  result.near_parallel = estimate.near_parallel, result.faults = estimate.faults;
  return result;
}

// The intersections of parallel lines are arbitrary.
RcmResult pairwise_result(const std::vector<LineObservation>& lines, const RcmResult& weighted) {
  RcmResult result;
  result.method = "pairwise";
  result.lines = static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), is_usable));
  const bool parallel = weighted.status == to_string(RcmStatus::parallel);
  const auto mean = parallel ? std::nullopt : mean_of_intersections(lines);
  result.status = to_string(mean ? RcmStatus::ok : result.lines < 2 ? RcmStatus::too_few_lines : RcmStatus::parallel);
  if (!mean) return result;
  result.point_px = mean->point_px;
  result.covariance_px2 = mean->covariance_px2;
  return result;
}

std::string number_or_empty(std::optional<double> value) {
  return value ? fmt::format("{:.6g}", *value) : "";
}

}  // namespace

std::array<RcmResult, 2> estimate_rcm(const std::vector<LineObservation>& lines, double sigma_px, double common_px) {
  const RcmResult weighted = weighted_result(lines, sigma_px, common_px);
  return {weighted, pairwise_result(lines, weighted)};
}

void write_rcm_results(std::ostream& out, const std::vector<RcmResult>& results) {
  out << "instrument,method,status,lines,outliers,rcm_u_px,rcm_v_px,sigma_u_px,sigma_v_px,correlation,noise_px,"
         "chi2,direction_spread_rad,near_parallel,rig_u_px,rig_v_px,distance_px\n";
  for (const RcmResult& r : results) {
    const auto of = [](const auto& optional, auto get) {
      return optional ? std::optional<double>(get(*optional)) : std::nullopt;
    };
    const auto sigma = [&](Eigen::Index i) {
      return of(r.covariance_px2, [&](const Eigen::Matrix2d& c) { return std::sqrt(c(i, i)); });
    };
    const auto u = [](const Eigen::Vector2d& p) { return p.x(); };
    const auto v = [](const Eigen::Vector2d& p) { return p.y(); };
    std::string row = fmt::format("{},{},{},{},{}", csv_field(r.instrument), r.method, r.status, r.lines, r.outliers);
    const auto correlation = [](const Eigen::Matrix2d& c) {
      const double scale = std::sqrt(c(0, 0) * c(1, 1));
      return scale > 0 ? c(0, 1) / scale : 0;
    };
    const auto distance = r.point_px && r.rig_px ? std::optional((*r.point_px - *r.rig_px).norm()) : std::nullopt;
    for (const auto& value : {of(r.point_px, u), of(r.point_px, v), sigma(0), sigma(1),
                              of(r.covariance_px2, correlation), r.noise_px, r.chi2, r.spread_rad})
      row += "," + number_or_empty(value);
    row += r.near_parallel ? ",1" : ",0";
    for (const auto& value : {of(r.rig_px, u), of(r.rig_px, v), distance}) row += "," + number_or_empty(value);
    out << row << '\n';
  }
}

}  // namespace lapservo::internal
