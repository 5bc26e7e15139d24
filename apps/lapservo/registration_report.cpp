#include "apps/lapservo/registration_report.h"

#include <cmath>

#include <fmt/format.h>

#include "lapservo/calibration/registration_measurement.h"
#include "lapservo/experiments/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

Plot plot_of(const Registration& registration, const std::string& title, const std::string& label,
             const std::string& unit, double RegistrationResidual::*what) {
  Plot plot;
  plot.title = title;
  plot.x = {.label = "time", .unit = "s", .low = {}, .high = {}};
  plot.y = {.label = label, .unit = unit, .low = 0, .high = {}};
  Series series{.name = label, .x = {}, .y = {}, .sigma = {}, .draw = Draw::points, .color = 0};
  for (const RegistrationResidual& r : registration.residuals)
    series.x.push_back(r.time_s), series.y.push_back(1e3 * (r.*what));
  plot.series.push_back(std::move(series));
  return plot;
}

std::string number(double value) {
  return std::isfinite(value) ? fmt::format("{:.4f}", value) : "";
}

}  // namespace

void write_registration_report(const std::filesystem::path& path, const Instrument& instrument,
                               const Registration& registration) {
  ReportSection section;
  section.id = "registration";
  section.title = instrument.name;
  section.text = {
      fmt::format("Where the arm stands before the camera, from {} frames.", registration.residuals.size())};
  if (registration.arm) {
    section.figures = {
        {plot_of(registration, "The marker's place", "off by", "mm", &RegistrationResidual::position_m),
         "Between where the marker was seen and where joints and registration have it."},
        {plot_of(registration, "The shaft's direction", "off by", "mrad", &RegistrationResidual::axis_rad),
         "The same for the axis."},
        {plot_of(registration, "The rotation about the shaft", "off by", "mrad", &RegistrationResidual::roll_rad),
         "The same for the turn about the axis. Steps that come with reversals are backlash; what goes with speed is "
         "delay."}};
  } else {
    section.figures = {{plot_of(registration, "Axes and the RCM", "miss", "mm", &RegistrationResidual::position_m),
                        "By how much each frame's axis misses the point where they meet."}};
  }
  Table table{"One standard deviation each; the rotation before: its angle from that after",
              {"", "before", "after", "sigma"},
              {}};
  for (const CalibratedNumber& n : registered_numbers(instrument, registration))
    table.rows.push_back({n.name, number(n.before), number(n.after), number(n.sigma)});
  section.tables = {table};
  section.notes = registration.unknown;
  Report report;
  report.title = "lapservo calibrate registration";
  report.sections = {section};
  write_report(path, report);
}

}  // namespace lapservo::app
