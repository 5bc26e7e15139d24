#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <optional>
#include <string>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/check/rig_check.h"
#include "lapservo/calibration/check/work_space.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/report/html_report.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/tool/dvrk_tool_file.h"

namespace lapservo::app {
using namespace internal;
namespace {

// All that `check` found out.
struct CheckedRig {
  RigFindings findings;
  std::vector<FrameEvidence> frames;
  std::vector<Advice> advice;
  std::string tissue_hue;          // tissue_hue_text()
  std::string exact_registration;  // exact_registration_text()
  std::string tip;                 // how well it is known, or why not; empty without a tool
  // A frame of each kind with the pixels that have a band's hue painted (segmentation_picture); empty without such a
  // frame.
  cv::Mat found_segmented, missed_segmented;

  bool good_enough() const { return std::ranges::none_of(advice, &Advice::needed); }
};

// A topic each: its name and what was found.
using CheckLines = std::vector<std::vector<std::string>>;

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

CheckLines arm_lines(const ArmCheck& arm) {
  if (!arm.refusal.empty()) return {{"joints", "can't be compared: " + arm.refusal}};
  const auto px = [](const ArmResidual& r) { return r.pixel_px; };
  const auto psi = [](const TrackedPsi& off) { return 1e3 * off.psi_rad; };
  const bool rig = !arm.by_rig.empty();
  CheckLines lines{
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

CheckLines rcm_lines(const RcmCheck& rcm) {
  if (!rcm.refusal.empty()) return {{"RCM", "unknown: " + rcm.refusal}};
  CheckLines lines;
  lines.push_back({"RCM", fmt::format("axes miss where they meet by {:.2f} mm rms",
                                      1e3 * rms(rcm.misses_m, [](const auto& miss) { return miss.second; })) +
                              ", which is off the rig's by " + told(rcm.distance_m, 1e3, "mm")});
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
  if (f.work_space)
    for (const SigmaMap& map : f.work_space->maps)
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

std::string encoding_text(const RigFindings& f) {
  const std::string edges =
      f.response ? fmt::format(
                       "channels' edges lie {:.3f} px apart with the rig's response, {:.3f} with the best of the "
                       "usual ones; {:.3f} and less is good enough",
                       f.response->before_px, f.response->after_px, rig_limits.response_px)
                 : "too few edges of channels to compare responses";
  if (f.response_measured) return edges;
  return edges +
         "; the rig's response has no standard deviation and counts as exact, so that psi's sigma lacks its part: "
         "lapservo calibrate camera measures both";
}

CheckLines check_lines(const CheckedRig& checked) {
  const RigFindings& f = checked.findings;
  CheckLines lines{{"marker", fmt::format("found in {} of {} frames", f.found, f.frames)}};
  if (f.light) {
    lines.push_back({"light", fmt::format("the marker's values reach {:.0f} of 255, {:.1f} % saturated; between its "
                                          "brightest and darkest channel {:.0f}",
                                          f.light->value, 100 * f.light->clipped, f.light->chroma)});
    lines.push_back({"colours", fmt::format("within {:.0f} degrees of the rig's hues", f.hue_error_deg)});
    lines.push_back({"encoding", encoding_text(f)});
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
  const auto more = f.arm ? arm_lines(*f.arm) : f.rcm ? rcm_lines(*f.rcm) : CheckLines{};
  lines.insert(lines.end(), more.begin(), more.end());
  if (!checked.tissue_hue.empty()) lines.push_back({"warning", checked.tissue_hue});
  if (!checked.exact_registration.empty()) lines.push_back({"standard deviations", checked.exact_registration});
  if (!checked.tip.empty()) lines.push_back({"tip", checked.tip});
  if (f.work_space && f.work_space->places > 0)
    lines.push_back(
        {"work space", fmt::format("sigma of psi at most {:.0f} mrad in {:.0f} % of {} places, up to {:.1f}",
                                   1e3 * rig_limits.sigma_rad, 100 * f.work_space->good, f.work_space->places,
                                   1e3 * f.work_space->worst_rad) +
                           (f.work_space->lost ? fmt::format("; not found in {}", f.work_space->lost) : "")});
  return lines;
}

// "good enough", or "not good enough: " and what to do first.
std::string verdict_of(const CheckedRig& checked) {
  if (checked.good_enough()) return "good enough";
  return "not good enough: " + checked.advice.front().what;
}

// Where that holds.
std::string region_of(const CheckedRig& checked) {
  const auto& arm = checked.findings.arm;
  if (arm && arm->refusal.empty()) return "checked where " + arm->region + "; beyond that, repeat with a wider swing";
  return "checked by images alone: not the joints, nor where they put the marker";
}

Report page_of(const std::string& instrument, const CheckedRig& checked) {
  ReportSection section{"check", instrument + ": " + verdict_of(checked),
                        checked.good_enough() ? Verdict::good : Verdict::bad};
  section.text.push_back(region_of(checked));
  int rank = 0;
  for (const Advice& advice : checked.advice)
    section.text.push_back(fmt::format("{}. {}{}. Do: {}. Gains: {}.", ++rank,
                                       advice.needed ? "" : "Good enough without, but: ", advice.what, advice.command,
                                       advice.gain));
  section.figures = figures_of(checked);
  section.tables = {{"Results", {"", ""}, check_lines(checked), true}};
  section.notes = {
      "Each of focal length, drift, delay and registration is what is left of it with the others taken out.",
      "Sigmas over the work space are those of rendered frames, times what the recording's own have over "
      "renderings of the same poses."};
  return {"lapservo check", {}, {section}};
}

void print(const CheckedRig& checked) {
  for (const auto& line : check_lines(checked)) std::printf("  %-26s %s\n", line[0].c_str(), line[1].c_str());
  const bool colours = ::isatty(STDOUT_FILENO) != 0 && !std::getenv("NO_COLOR");
  const char* colour = !colours ? "" : checked.good_enough() ? "\033[32m" : "\033[31m";
  std::printf("\n%s%s%s\n  %s\n", colour, verdict_of(checked).c_str(), colours ? "\033[0m" : "",
              region_of(checked).c_str());
  int rank = 0;
  for (const Advice& advice : checked.advice)
    std::printf("  %d. %s%s\n     do: %s\n     gains: %s\n", ++rank, advice.needed ? "" : "(may be) ",
                advice.what.c_str(), advice.command.c_str(), advice.gain.c_str());
}

// Medians over the frames, the largest part first.
std::string tip_text(const Instrument& instrument, const std::vector<FrameEvidence>& frames, WristInput wrist) {
  std::vector<double> whole_mm;
  std::array<std::pair<std::vector<double>, const char*>, 3> parts{
      {{{}, "the shaft"}, {{}, "the marker's place"}, {{}, "the wrist's joints"}}};
  for (const FrameEvidence& frame : frames) {
    Observation seen;
    seen.status = frame.status, seen.marker = frame.marker;
    const auto tip = seen.tip = tip_of(seen, *instrument.tool, wrist_at(wrist, instrument, frame.time_s));
    wrist.add(seen, frame.time_s);
    if (!tip) continue;
    whole_mm.push_back(1e3 * tip->sigma_m());
    parts[0].first.push_back(1e3 * tip->sigma_shaft_m), parts[1].first.push_back(1e3 * tip->sigma_place_m);
    parts[2].first.push_back(1e3 * tip->sigma_readings_m);
  }
  const std::string why = no_tip_text(instrument, wrist) + no_reading_text(instrument, wrist);
  if (whole_mm.empty()) return "unknown: " + (why.empty() ? "no frame has the marker and readings" : why);
  std::vector<std::pair<double, const char*>> sizes_mm;
  for (auto& [all_mm, from] : parts)
    if (const double size_mm = median(all_mm); size_mm > 0) sizes_mm.emplace_back(size_mm, from);
  std::sort(sizes_mm.rbegin(), sizes_mm.rend());
  std::vector<std::string> texts;
  for (const auto& [size_mm, from] : sizes_mm) texts.push_back(fmt::format("{:.2g} from {}", size_mm, from));
  const std::string on_axis = axis_tip_text(*instrument.tool);
  return fmt::format("known to {:.2g} mm: {}{}{}", median(whole_mm), fmt::join(texts, ", "),
                     on_axis.empty() ? "" : "; ", on_axis);
}

}  // namespace

int check(const CalibrateOptions& options) {
  InstrumentJob job(options);
  const Rig& rig = job.rig;
  const std::size_t index = job.index;
  Instrument instrument = job.instrument();
  const auto joints = find_joint_input(options, job.rig, job.index, job.frames.get());
  if (joints) instrument.joints = joints->joints;
  job.begin();
  constexpr int enough = 1800;
  RigEvidence evidence(rig, index);
  FrameDiagnosis diagnosis(rig, options.deinterlace);
  cv::Mat seen, missed;  // the last frames with and without the marker
  int count = 0;         // of those with it
  const FramesRead read = read_frames(job.recording(), rig, every_of(*job.frames, enough), watched_job(),
                                      [&](const cv::Mat& bgr, double time_s) {
                                        const bool found = evidence.add(bgr, time_s);
                                        diagnosis.add(bgr, {});
                                        (found ? seen : missed) = bgr, count += found;
                                        return fmt::format(", {} in {}", instrument.name, count);
                                      });
  if (read.stopped) return refuse(options.input, "stopped");
  say_complaint(options.input, read.complaint);
  CheckedRig checked;
  {
    Progress progress(std::nullopt);
    progress.show(1, " of 3: the arm");
    checked.findings = findings_of(rig, index, evidence);
    checked.frames = evidence.frames();
    checked.findings.lossy = read.lossy;
    if (std::string& cause = checked.findings.cause; checked.findings.found == 0) {
      cause = diagnosis.cause();
      if (cause.empty() && checked.findings.failure == Status::no_marker)
        if (const std::string background = diagnosis.background(index); !background.empty())
          cause = fmt::format(": {}{}", usual_cause(Status::no_marker), background);
    }
    // Takes as long as the rest, which needs nothing of it.
    std::future<PrintCheck> print;
    if (checked.findings.light)
      print = std::async(std::launch::async, [&, frames = evidence.take_key_frames()]() mutable {
        return check_print(rig, index, std::move(frames));
      });
    checked.findings.has_joints = joints.has_value();
    if (joints && !evidence.poses().empty())
      checked.findings.arm = check_arm(instrument, rig.camera, evidence.poses(), evidence.tracked_psi(),
                                       joints->recording, joints->source);
    else if (instrument.camera_from_rcm)
      checked.findings.rcm = check_rcm(instrument, evidence.poses());
    progress.show(2, " of 3: the work space");
    checked.findings.work_space = survey_work_space(rig, index, evidence);
    progress.show(3, " of 3: the print");
    if (print.valid()) checked.findings.print = print.get();
  }
  checked.advice = advice_on(checked.findings);
  if (instrument.tool)
    checked.tip = tip_text(instrument, checked.frames, find_wrist_input(options, rig, index, *job.frames, true));
  checked.tissue_hue = tissue_hue_text(instrument.marker);
  checked.exact_registration = exact_registration_text(instrument);
  std::printf("%s\n", instrument.name.c_str());
  print(checked);
  if (job.page) {
    if (!seen.empty()) checked.found_segmented = segmentation_picture(seen, rig);
    if (!missed.empty()) checked.missed_segmented = segmentation_picture(missed, rig);
    job.write_page(page_of(instrument.name, checked));
  }
  return checked.good_enough() ? 0 : 1;
}

void add_check(Command app) {
  auto [command, options] = app.add_subcommand<CalibrateOptions>(
      "check", "Check whether a rig is good enough, and what to improve first.", check);
  command.add_option("input", options.input, required(),
                     "A short recording of the marker in motion: a folder, a video or a bag");
  command.add_option("--rig", options.rig, required(), "The rig to check");
  add_joint_options(
      command, options,
      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or a bag; "
      "without it those in the input, where it is a bag: registration, delay, focal length and drift too");
  add_recording_options(command, options);
  command.add_option("--out", options.report, "HTML page with figures");
  command.footer(
      "Swing, insert and withdraw the instrument, and turn it about its axis once, in 10 to 60 s, the marker in view.\n"
      "Exit code 0: good enough, 1: not good enough.\n"
      "Example:\n  lapservo check swing.mp4 --joints joints.csv --rig rig.yaml --out check.html");
}

}  // namespace lapservo::app
