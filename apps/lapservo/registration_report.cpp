#include "apps/lapservo/registration_report.h"

#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lapservo/experiments/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

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

std::vector<CalibratedNumber> registered_numbers(const Instrument& before, const Registration& registration) {
  std::vector<CalibratedNumber> numbers;
  const auto add = [&](const std::string& name, double was, double is, double sigma) {
    numbers.push_back({name, 1e3 * was, 1e3 * is, 1e3 * sigma});
  };
  constexpr std::array<const char*, 3> axes{"x", "y", "z"};
  const auto& was = before.camera_from_rcm;
  for (Eigen::Index i = 0; i < 3; ++i)
    add(fmt::format("camera_from_rcm {} [mm]", axes[static_cast<std::size_t>(i)]), was ? was->translation[i] : unknown,
        registration.camera_from_rcm.translation[i], registration.sigma_translation_m[i]);
  if (registration.sigma_quaternion)
    add("its rotation [mrad]", was ? was->rotation.angularDistance(registration.camera_from_rcm.rotation) : unknown, 0,
        registration.sigma_rotation_rad);
  if (!registration.arm) return numbers;
  const Registration::Arm& arm = *registration.arm;
  constexpr std::array<const char*, 4> units{"theta [mrad]", "phi [mrad]", "rho [mm]", "psi [mrad]"};
  for (std::size_t i = 1; i < 4; ++i)
    add(fmt::format("offset of {}", units[i]), before.joints->offset[i], arm.joints.offset[i], arm.sigma_offset[i]);
  add("image_delay_s [ms]", before.image_delay_s.value_or(unknown), arm.image_delay_s, arm.sigma_image_delay_s);
  return numbers;
}

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
