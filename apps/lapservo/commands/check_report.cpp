#include "apps/lapservo/commands/check_report.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/report/html_report.h"

namespace lapservo::app {
using namespace internal;
namespace {

Plot over_time(const std::string& title, const std::string& label, const std::string& unit) {
  Plot plot = time_plot(title, label, unit, {});
  plot.y.low = 0;
  return plot;
}

template <typename Items, typename PointOf>
void add_points(Plot& plot, const std::string& name, int colour, const Items& items, PointOf point_of,
                Draw draw = Draw::points) {
  Series series = series_of(name, items, point_of, draw, colour);
  if (!series.x.empty()) plot.series.push_back(std::move(series));
}

Plot arm_plot(const ArmCheck& arm, const std::string& title, const std::string& unit, double factor,
              double ArmResidual::*what) {
  Plot plot = over_time(title, "off by", unit);
  const auto point = [&](const ArmResidual& r) { return PlotPoint({r.time_s, factor * (r.*what)}); };
  add_points(plot, "as the rig has it", 1, arm.by_rig, point, Draw::rings);
  add_points(plot, "after a calibration", 0, arm.at_best, point);
  return plot;
}

Plot encoder_plot(const ArmCheck& arm) {
  Plot plot = time_plot("Rotation against encoder", "psi beyond the encoder", "mrad", {});
  plot.references = {{"the encoder", 0}};
  add_points(plot, "as the rig has it", 1, arm.beyond_encoder, [](const TrackedPsi& off) {
    return PlotPoint({off.time_s, 1e3 * off.psi_rad});
  });
  return plot;
}

Plot sigma_plot(const std::vector<FrameEvidence>& frames) {
  Plot plot = over_time("Sigma of psi", "sigma", "mrad");
  add_points(plot, "sigma", 0, frames, [](const FrameEvidence& frame) {
    return frame.status == Status::ok ? PlotPoint({frame.time_s, 1e3 * frame.sigma_roll_rad}) : std::nullopt;
  });
  return plot;
}

Plot light_plot(const std::vector<FrameEvidence>& frames) {
  Plot plot = over_time("Light on the marker", "brightest channel", "of 255");
  add_points(plot, "brightest channel", 0, frames, [](const FrameEvidence& frame) {
    return frame.light ? PlotPoint({frame.time_s, frame.light->value}) : std::nullopt;
  });
  return plot;
}

// Points of one boundary, by parts of the roll: a page with thousands of points would not open.
Series residual_means(const std::vector<PrintResidual>& residuals, std::size_t boundary) {
  constexpr std::size_t parts = 60;
  constexpr int least = 3;
  std::array<double, parts> sums_m{};
  std::array<int, parts> counts{};
  for (const PrintResidual& r : residuals) {
    if (r.boundary != boundary) continue;
    const auto part = static_cast<std::size_t>(std::clamp(r.tau_rad / two_pi * parts, 0.0, parts - 1.0));
    sums_m[part] += r.residual_m, counts[part] += 1;
  }
  Series series{fmt::format("e{}", boundary), {}, {}, Draw::points, static_cast<int>(boundary)};
  for (std::size_t part = 0; part < parts; ++part) {
    if (counts[part] < least) continue;
    series.x.push_back(360 * (static_cast<double>(part) + 0.5) / parts);
    series.y.push_back(1e3 * sums_m[part] / counts[part]);
  }
  return series;
}

Plot print_plot(const std::vector<PrintResidual>& residuals) {
  Plot plot{"Boundaries about the rig's print",
            {"tau", "deg", 0, 360},
            {"along the shaft", "mm"},
            {},
            {{"the rig's print", 0}}};
  for (std::size_t boundary = 0; boundary < 4; ++boundary) plot.series.push_back(residual_means(residuals, boundary));
  return plot;
}

// Light where sigma is small, orange at the limit, dark beyond it; the lightness alone distinguishes them, too.
cv::Scalar colour_of(double sigma_rad) {
  const double part = std::min(1.0, sigma_rad / (2 * rig_limits.sigma_rad));
  const cv::Scalar small(250, 240, 225), large(20, 70, 190);
  return small + part * (large - small);
}

// Where there is no sigma: "not found", "not in view".
void name_cell(cv::Mat& canvas, const cv::Rect& cell, const char* what, const cv::Scalar& ink) {
  int y = 42;
  for (const char* word : {"not", what}) {
    cv::putText(canvas, word, cell.tl() + cv::Point(14, y), cv::FONT_HERSHEY_SIMPLEX, 0.55, ink, 1, cv::LINE_AA);
    y += 22;
  }
}

Picture map_picture(const SigmaMap& map) {
  constexpr int cell_px = 92;
  cv::Mat canvas(cell_px * SigmaMap::rows, cell_px * SigmaMap::columns, CV_8UC3, cv::Scalar(255, 255, 255));
  for (int row = 0; row < SigmaMap::rows; ++row)
    for (int column = 0; column < SigmaMap::columns; ++column) {
      const cv::Rect cell(cell_px * column, cell_px * row, cell_px, cell_px);
      const auto at = static_cast<std::size_t>(row * SigmaMap::columns + column);
      const auto& sigma_rad = map.sigma_rad[at];
      if (map.lost[at]) cv::rectangle(canvas, cell, cv::Scalar(60, 60, 60), cv::FILLED);
      if (sigma_rad) cv::rectangle(canvas, cell, colour_of(*sigma_rad), cv::FILLED);
      cv::rectangle(canvas, cell, cv::Scalar(200, 200, 200));
      const bool beyond = map.lost[at] || (sigma_rad && *sigma_rad > 1.4 * rig_limits.sigma_rad);
      const cv::Scalar ink = beyond ? cv::Scalar(255, 255, 255) : cv::Scalar(50, 50, 50);
      if (sigma_rad)
        cv::putText(canvas, fmt::format("{:.2g}", 1e3 * *sigma_rad), cell.tl() + cv::Point(24, 54),
                    cv::FONT_HERSHEY_SIMPLEX, 0.8, ink, 2, cv::LINE_AA);
      else
        name_cell(canvas, cell, map.lost[at] ? "found" : "in view", ink);
    }
  return {fmt::format("Sigma of psi [mrad] at {:.0f} mm", 1e3 * map.depth_m), canvas};
}

std::string told(const Told& t, double factor, const char* unit) {
  return fmt::format("{:.2f} {} (sigma {:.2f})", factor * t.value, unit, factor * t.sigma);
}

std::vector<CheckLine> arm_lines(const ArmCheck& arm) {
  if (!arm.refusal.empty()) return {{"joints", "can't be compared: " + arm.refusal}};
  const auto px = [](const ArmResidual& r) { return r.pixel_px; };
  const auto psi = [](const TrackedPsi& off) { return 1e3 * off.psi_rad; };
  const bool rig = !arm.by_rig.empty();
  std::vector<CheckLine> lines{
      {"reprojection", (rig ? fmt::format("{:.2f} px rms; ", rms(arm.by_rig, px)) : "") +
                           fmt::format("{:.2f} px after a calibration, {:.1f} times the images' noise",
                                       rms(arm.at_best, px), arm.noise_across)},
      {"rotation against encoder",
       (rig && !arm.beyond_encoder.empty() ? fmt::format("{:.1f} mrad rms; ", rms(arm.beyond_encoder, psi)) : "") +
           fmt::format("{:.1f} mrad after a calibration, {:.1f} times the images' noise",
                       1e3 * rms(arm.at_best, &ArmResidual::roll_rad), arm.noise_roll)},
      {"focal length", "off by " + told(arm.focal, 100, "%")},
      {"drift", "the marker moves by " + told(arm.drift_m, 1e3, "mm") + " over the recording, directions by " +
                    told(arm.drift_rad, 1e3, "mrad")},
      {"delay", arm.delay_s ? "off by " + told(*arm.delay_s, 1e3, "ms")
                            : fmt::format("{:.3f} s; the rig has none", arm.measured_delay_s)}};
  if (arm.place_m)
    lines.push_back({"registration", "puts the marker off by " + told(*arm.place_m, 1e3, "mm") + ", its axis by " +
                                         told(*arm.axis_rad, 1e3, "mrad") + ", its turn by " +
                                         told(*arm.roll_rad, 1e3, "mrad")});
  return lines;
}

std::vector<CheckLine> rcm_lines(const RcmCheck& rcm) {
  if (!rcm.refusal.empty()) return {{"RCM", "unknown: " + rcm.refusal}};
  std::vector<CheckLine> lines;
  lines.push_back(
      {"RCM", fmt::format("axes miss where they meet by {:.2f} mm rms",
                          1e3 * rms(rcm.misses_m, [](const auto& miss) { return miss.second; })) +
                  (rcm.distance_m ? ", which is off the rig's by " + told(*rcm.distance_m, 1e3, "mm") : "")});
  lines.push_back({"drift", "the RCM moves by " + told(rcm.drift_m, 1e3, "mm") + " over the recording"});
  return lines;
}

std::vector<Figure> figures_of(const CheckedRig& checked) {
  std::vector<Figure> figures;
  const RigFindings& f = checked.findings;
  if (f.arm && f.arm->refusal.empty()) {
    figures.push_back({arm_plot(*f.arm, "Reprojection", "px", 1, &ArmResidual::pixel_px),
                       "Between the marker's image and where joints and registration put it."});
    figures.push_back(
        {encoder_plot(*f.arm),
         "psi as the rig tracks it, less what the joints say. Steps that come with reversals are backlash."});
    figures.push_back({arm_plot(*f.arm, "The marker's place", "mm", 1e3, &ArmResidual::position_m),
                       "The same in space. Growth with time is drift, dependence on speed is delay."});
  }
  if (f.rcm && f.rcm->refusal.empty()) {
    Plot plot = over_time("Axes and the RCM", "miss", "mm");
    add_points(plot, "miss", 0, f.rcm->misses_m, [](const auto& miss) {
      return PlotPoint({miss.first, 1e3 * miss.second});
    });
    figures.push_back({std::move(plot), "By how much each frame's axis misses the point where they meet."});
  }
  figures.push_back(
      {sigma_plot(checked.frames), "Sigma of the rotation, as the tracker states it, in each frame where it is ok."});
  for (const SigmaMap& map : checked.maps)
    figures.push_back({map_picture(map),
                       fmt::format("Sigma of psi [mrad] to expect with the marker in each part of the image, {:.0f} "
                                   "mm away. Dark: it is wholly in view, and not found.",
                                   1e3 * map.depth_m)});
  figures.push_back({light_plot(checked.frames), "Median over the marker. Near 255 boundaries are lost."});
  if (f.print && f.print->refusal.empty())
    figures.push_back(
        {print_plot(f.print->residuals),
         "Where boundaries lie beyond the rig's print, means over 6 degrees. Straight lines off 0 are the "
         "print's errors."});
  for (const auto& [picture, caption] : {std::pair{checked.found_segmented, "where the marker is found"},
                                         {checked.missed_segmented, "where the marker is not found"}})
    if (!picture.empty())
      figures.push_back(
          {Picture{"Colours", picture},
           fmt::format("The pixels that have a band's colour by the rig's hues, in the last frame {}.", caption)});
  return figures;
}

}  // namespace

bool CheckedRig::good_enough() const {
  return std::none_of(advice.begin(), advice.end(), [](const Advice& a) { return a.needed; });
}

std::vector<CheckLine> check_lines(const CheckedRig& checked) {
  const RigFindings& f = checked.findings;
  std::vector<CheckLine> lines{{"marker", fmt::format("found in {} of {} frames", f.found, f.frames)}};
  if (f.light) {
    lines.push_back({"light", fmt::format("the marker's values reach {:.0f} of 255, {:.1f} % saturated; between its "
                                          "brightest and darkest channel {:.0f}",
                                          f.light->value, 100 * f.light->clipped, f.light->chroma)});
    lines.push_back({"colours", fmt::format("within {:.0f} degrees of the rig's hues", f.hue_error_deg)});
    if (f.response)
      lines.push_back(
          {"encoding", fmt::format("channels' edges lie {:.3f} px apart with the rig's response, {:.3f} with "
                                   "the best of the usual ones",
                                   f.response->before_px, f.response->after_px)});
    lines.push_back({"size", fmt::format("the shaft is {:.0f} px wide", f.width_px)});
  } else {
    lines.push_back({"light", fmt::format("the image's values reach {:.0f} of 255, {:.0f} % saturated", f.picture.value,
                                          100 * f.picture.clipped)});
  }
  if (f.print)
    lines.push_back({"print", f.print->refusal.empty()
                                  ? fmt::format("boundaries {:.2f} px rms about the rig's print, {:.2f} about the one "
                                                "that fits best; psi off by ",
                                                f.print->before_px, f.print->after_px) +
                                        told(f.print->psi_rad, 1e3, "mrad")
                                  : "unknown: " + f.print->refusal});
  const auto more = f.arm ? arm_lines(*f.arm) : f.rcm ? rcm_lines(*f.rcm) : std::vector<CheckLine>{};
  lines.insert(lines.end(), more.begin(), more.end());
  if (!checked.exact_registration.empty()) lines.push_back({"standard deviations", checked.exact_registration});
  if (!checked.tip.empty()) lines.push_back({"tip", checked.tip});
  if (f.work_space)
    lines.push_back(
        {"work space", fmt::format("sigma of psi at most {:.0f} mrad in {:.0f} % of {} places, up to {:.1f}",
                                   1e3 * rig_limits.sigma_rad, 100 * f.work_space->good, f.work_space->places,
                                   1e3 * f.work_space->worst_rad) +
                           (f.work_space->lost ? fmt::format("; not found in {}", f.work_space->lost) : "")});
  return lines;
}

std::string verdict_of(const CheckedRig& checked) {
  if (checked.good_enough()) return "good enough";
  return "not good enough: " + checked.advice.front().what;
}

std::string region_of(const CheckedRig& checked) {
  const auto& arm = checked.findings.arm;
  if (arm && arm->refusal.empty()) return "checked where " + arm->region + "; beyond that, repeat with a wider swing";
  return "checked by images alone: not the joints, nor where they put the marker";
}

void write_check_report(const std::filesystem::path& path, const std::string& instrument, const CheckedRig& checked) {
  ReportSection section{"check", instrument + ": " + verdict_of(checked),
                        checked.good_enough() ? Verdict::good : Verdict::bad};
  section.text.push_back(region_of(checked));
  int rank = 0;
  for (const Advice& advice : checked.advice)
    section.text.push_back(fmt::format("{}. {}{}. Do: {}. Gains: {}.", ++rank,
                                       advice.needed ? "" : "Good enough without, but: ", advice.what, advice.command,
                                       advice.gain));
  section.figures = figures_of(checked);
  Table table{"Results", {"", ""}, {}, true};
  for (const CheckLine& line : check_lines(checked)) table.rows.push_back({line.name, line.found});
  section.tables = {table};
  section.notes = {
      "Each of focal length, drift, delay and registration is what is left of it with the others taken out.",
      "Sigmas over the work space are those of rendered frames, times what the recording's own have over "
      "renderings of the same poses."};
  write_report(path, {"lapservo check", {}, {section}});
}

}  // namespace lapservo::app
