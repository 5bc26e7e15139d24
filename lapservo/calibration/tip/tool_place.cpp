#include "lapservo/calibration/tip/tool_place.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

// Azimuth and offsets stay; without a place any azimuth is possible, and offsets are as large as the readings' sigmas.
Tool::Place place_before(const Tool& tool) {
  if (tool.place) return *tool.place;
  Tool::Place place;
  if (tool.wrist.empty()) return place;
  const double any_azimuth_rad = std::numbers::pi / std::sqrt(3.0);
  place.covariance(3, 3) = any_azimuth_rad * any_azimuth_rad;
  for (std::size_t i = 0; i < tool.wrist.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(4 + i);
    place.covariance(k, k) = std::pow(tool.wrist[i].sigma_reading_rad, 2);
  }
  return place;
}

}  // namespace

Tool placed_by_tip(Tool tool, const std::vector<double>& wrist_rad, const Eigen::Vector3d& tip_in_marker_m,
                   const Eigen::Matrix3d& covariance_m2) {
  Tool::Place place = place_before(tool);
  place.base_in_marker_m.setZero();
  tool.place = place;
  place.base_in_marker_m = tip_in_marker_m - tip_in_marker(tool, wrist_rad).marker_from_tip.translation;
  const auto slopes = tip_slopes(tool, wrist_rad).topRightCorner<3, 5>().eval();
  const Eigen::Matrix<double, 5, 5> rest = place.covariance.bottomRightCorner<5, 5>();
  place.covariance.topLeftCorner<3, 3>() = covariance_m2 + slopes * rest * slopes.transpose();
  place.covariance.topRightCorner<3, 5>() = -slopes * rest;
  place.covariance.bottomLeftCorner<5, 3>() = place.covariance.topRightCorner<3, 5>().transpose();
  tool.place = place;
  return tool;
}

Tool placed_by_calliper(Tool tool, const Marker& marker, double distance_m, double sigma_m) {
  Tool::Place place = place_before(tool);
  double length_m2 = 0;  // the variance of the marker's: between its ends, or of its bands
  if (marker.sigmas.bands_upper_m)
    for (const double sigma : *marker.sigmas.bands_upper_m) length_m2 += sigma * sigma;
  length_m2 = std::max(length_m2, 2 * marker.tolerance_m * marker.tolerance_m);
  const double across_m2 = off_axis_sigma_m * off_axis_sigma_m;
  place.base_in_marker_m = {0, 0, marker.length_m() + distance_m};
  place.covariance.topRows<3>().setZero(), place.covariance.leftCols<3>().setZero();
  place.covariance.diagonal().head<3>() << across_m2, across_m2, sigma_m * sigma_m + length_m2;
  tool.place = place;
  return tool;
}

}  // namespace lapservo::internal
