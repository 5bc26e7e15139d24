#include "apps/lapservo/print_residual_plot.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/angles.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr int min_count = 3;

Series means(const std::vector<PrintResidual>& residuals, std::size_t boundary, const std::string& name, int parts) {
  const auto size = static_cast<std::size_t>(parts);
  std::vector<double> sums_m(size), counts(size);
  for (const PrintResidual& r : residuals) {
    if (r.boundary != boundary) continue;
    const auto part = static_cast<std::size_t>(std::clamp(r.tau_rad / two_pi * parts, 0.0, parts - 1.0));
    sums_m[part] += r.residual_m, counts[part] += 1;
  }
  Series series{.name = name, .x = {}, .y = {}, .sigma = {}, .draw = Draw::points, .color = static_cast<int>(boundary)};
  for (std::size_t part = 0; part < size; ++part) {
    if (counts[part] < min_count) continue;
    series.x.push_back(360 * (static_cast<double>(part) + 0.5) / parts);
    series.y.push_back(1e3 * sums_m[part] / counts[part]);
  }
  return series;
}

}  // namespace

Plot print_residual_plot(const std::string& title, const std::vector<PrintResidual>& residuals,
                         const std::array<std::string, 4>& names, const std::string& reference, int parts) {
  Plot plot;
  plot.title = title;
  plot.x = {.label = "tau", .unit = "deg", .low = 0, .high = 360};
  plot.y = {.label = "along the shaft", .unit = "mm", .low = {}, .high = {}};
  plot.references = {{reference, 0}};
  for (std::size_t k = 0; k < names.size(); ++k) plot.series.push_back(means(residuals, k, names[k], parts));
  return plot;
}

}  // namespace lapservo::app
