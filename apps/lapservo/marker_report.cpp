#include "apps/lapservo/marker_report.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/print_residual_plot.h"
#include "lapservo/calibration/marker_measurement.h"
#include "lapservo/core/angles.h"
#include "lapservo/experiments/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

const std::array<std::string, 4> boundary_names{"e0 (proximal end)", "e1", "e2", "e3 (distal end)"};

void add_print(Plot& plot, const Marker& marker, const std::string& name, Draw draw) {
  constexpr int steps = 24;
  for (std::size_t k = 0; k < 4; ++k) {
    Series series{.name = fmt::format("{}, {}", boundary_names[k], name),
                  .x = {},
                  .y = {},
                  .sigma = {},
                  .draw = draw,
                  .color = static_cast<int>(k)};
    for (int i = 0; i <= steps; ++i) {
      const double tau_rad = std::nextafter(marker.covered_rad(), 0.0) * i / steps;
      series.x.push_back(deg_from_rad(tau_rad));
      series.y.push_back(1e3 * boundaries_m(marker, tau_rad)[k]);
    }
    plot.series.push_back(std::move(series));
  }
}

Plot print_plot(const Marker& before, const Marker& after) {
  Plot plot;
  plot.title = "Boundaries over the print";
  plot.x = {.label = "tau", .unit = "deg", .low = 0, .high = 360};
  plot.y = {.label = "from the proximal end", .unit = "mm", .low = {}, .high = {}};
  add_print(plot, before, "rig", Draw::dashed);
  add_print(plot, after, "calibrated", Draw::line);
  return plot;
}

Table table_of(const std::vector<CalibratedNumber>& numbers) {
  Table table{"One standard deviation each", {"", "before", "after", "sigma"}, {}};
  for (const CalibratedNumber& n : numbers)
    table.rows.push_back(
        {n.name, fmt::format("{:.4f}", n.before), fmt::format("{:.4f}", n.after), fmt::format("{:.4f}", n.sigma)});
  return table;
}

}  // namespace

void write_marker_report(const std::filesystem::path& path, const Instrument& instrument,
                         const MarkerCalibration& calibration) {
  ReportSection section;
  section.id = "marker";
  section.title = "The marker of " + instrument.name;
  section.text = {
      fmt::format("{} frames from all sides, {} of them with the seam. Boundaries miss the rig's print by "
                  "{:.3f} px rms and the calibrated one by {:.3f} px, each with the poses that fit it best.",
                  calibration.frames, calibration.seam_views, calibration.before_px, calibration.after_px)};
  const auto residual_plot = [](const std::string& title, const std::vector<PrintResidual>& residuals) {
    return print_residual_plot(title, residuals, boundary_names, "the print", 120);
  };
  section.figures = {{residual_plot("Before: the rig's print", calibration.before),
                      "Where boundaries were found, beyond where the rig's print has them; means over 3 degrees."},
                     {residual_plot("After: the calibrated print", calibration.after),
                      "The same for the calibrated print. What is left and runs straight is none of its errors."},
                     {print_plot(instrument.marker, calibration.marker), "Both prints, unrolled."}};
  section.tables = {table_of(
      calibrated_numbers(instrument.marker, calibration.marker, calibration.marker.sigmas.seam_rad.has_value()))};
  section.notes = {"Lengths count in diameters: the rig's diameter_m is taken for right."};
  Report report;
  report.title = "lapservo calibrate marker";
  report.sections = {section};
  write_report(path, report);
}

}  // namespace lapservo::app
