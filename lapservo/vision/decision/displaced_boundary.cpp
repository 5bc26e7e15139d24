#include "lapservo/vision/decision/displaced_boundary.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/inplace_vector.h"

namespace lapservo::internal {
namespace {

constexpr const DisplacedLimits& limits = displaced_limits;

using Residuals = InplaceVector<double, EdgeMeasurements::max_lines>;

bool is_doubtful(const FineFit& fit, std::size_t boundary) {
  return fit.used[boundary] < fine_fit_limits.well_seen_fraction * fit.lines;
}

// The largest number of residuals that lie about one of them.
int most_alike(const Residuals& residuals_px) {
  std::ptrdiff_t most = 0;
  for (const double middle_px : residuals_px)
    most = std::max(most, std::count_if(residuals_px.begin(), residuals_px.end(), [&](double residual_px) {
                      return std::abs(residual_px - middle_px) < limits.alike_px;
                    }));
  return static_cast<int>(most);
}

// `bias_px`: by how much the camera's processing may have moved it.
bool shows_elsewhere(const EdgeMeasurements& edges, std::size_t boundary, double bias_px, double tolerance_m) {
  Residuals elsewhere_px;
  int agreeing = 0;
  for (const Measurement& m : edges.all) {
    if (m.group != boundary) continue;
    const double sigma_px = std::hypot(m.sigma_px, tolerance_m * m.along_px_per_m);
    if (std::abs(m.residual_px) < bias_px + std::max(limits.agreeing_px, limits.agreeing_sigmas * sigma_px))
      ++agreeing;
    else if (m.sigma_px < limits.max_sigma_px)
      elsewhere_px.push_back(m.residual_px);
  }
  return most_alike(elsewhere_px) >= std::max(limits.min_lines, agreeing + 1);
}

}  // namespace

bool may_be_displaced(const FineFit& fit) {
  return is_doubtful(fit, 1) || is_doubtful(fit, 2);
}

bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit) {
  constexpr Effort farther{8, 0, 3, 1};
  const DepartedLight seen(light, fit.departure);
  const EdgeMeasurements edges = measure_edges(scene, seen.light(), fit.unknowns, film_mean_m, farther, fit.blur);
  for (const std::size_t boundary : {1U, 2U})
    if (is_doubtful(fit, boundary) &&
        shows_elsewhere(edges, boundary, fit.bias_px[boundary], scene.marker.boundary_sigma_m()))
      return true;
  return false;
}

}  // namespace lapservo::internal
