// The report's text of section V-D. Its numbers come from the configuration and the runs.

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/core/angles.h"
#include "lapservo/experiments/statistics.h"
#include "lapservo/experiments/tracking.h"
#include "lapservo/sim/simulator.h"

namespace lapservo::internal {
namespace {

struct FeatureName {
  const char *name, *column, *unit;
  double scale;  ///< from the column's unit
};
constexpr std::array features{FeatureName{"s", "s_rad", "mrad", 1000}, FeatureName{"r", "r_px", "px", 1},
                              FeatureName{"l", "l_px", "px", 1}, FeatureName{"d", "d_px", "px", 1}};

// Null when it was stopped before its end.
const TrackingRun* run_of(const TrackingResult& result, const std::string& id) {
  const auto run = std::ranges::find(result.runs, id, [](const TrackingRun& one) { return one.scenario.id; });
  return run == result.runs.end() ? nullptr : &*run;
}

// The results of a finished run.
template <class Say>
std::string text_of(const TrackingResult& result, const std::string& id, Say say) {
  const TrackingRun* run = run_of(result, id);
  return run ? say(*run) : "";
}

std::string features_text(const Eigen::Vector4d& values) {
  return fmt::format("s {:.2f} mrad; r {:.2f}, l {:.2f}, d {:.2f} px", 1000 * values[0], values[1], values[2],
                     values[3]);
}

std::string decay_text(double decay_per_s) {
  return std::isfinite(decay_per_s) ? fmt::format("{:.3f}", decay_per_s) : "\u2013";
}

std::string decays_text(const Eigen::Vector4d& decay_per_s) {
  return fmt::format("{}, {}, {}, {} /s", decay_text(decay_per_s[0]), decay_text(decay_per_s[1]),
                     decay_text(decay_per_s[2]), decay_text(decay_per_s[3]));
}

std::string converged_text(const TrackingRun& run) {
  return run.converged_s ? fmt::format("after {:.1f} s", *run.converged_s)
                         : fmt::format("not within {:.0f} s", run.scenario.duration_s);
}

std::string trajectory_text() {
  const Sinusoids f = paper_sinusoids();
  return fmt::format(
      "s = {} \u00b1 {} rad, r = {} \u00b1 {}, l = {} \u00b1 {} and d = {} \u00b1 {} px, all at {} rad/s", f.offset[0],
      f.amplitude[0], f.offset[1], f.amplitude[1], f.offset[2], f.amplitude[2], f.offset[3], f.amplitude[3],
      f.omega_rad_s[0]);
}

// Figure 7, a feature at a time, whole.
Plot figure_7(const TrackingResult& result, const FeatureName& feature) {
  const std::string column = std::string("error_") + feature.column;
  Plot plot =
      time_plot(fmt::format("Error of {}", feature.name), fmt::format("error of {}", feature.name), feature.unit, {});
  int colour = 0;
  for (const auto& [id, name] :
       {std::pair{"default", "the default"}, std::pair{"paper", "the paper\u2019s law, Algorithm 1"},
        std::pair{"paper_surface", "the paper\u2019s law, our tracker"}})
    if (const TrackingRun* run = run_of(result, id))
      plot.series.push_back(over_time(run->table, column, name, colour++, Draw::line, feature.scale));
  return plot;
}

Plot feature_plot(const TrackingRun& run, const FeatureName& feature) {
  const std::string column = feature.column, unit = column.substr(column.rfind('_') + 1);
  return time_plot(fmt::format("{}: {}", feature.name, run.scenario.title), feature.name, unit,
                   {over_time(run.table, "desired_" + column, "desired", -1, Draw::dashed),
                    over_time(run.table, "true_" + column, "reached", 0)});
}

// Plot of r, l and d, scaled to their range from a time on.
Plot error_plot(const TrackingRun& run, double from_s) {
  double max_px = 0;
  for (const char* column : {"error_r_px", "error_l_px", "error_d_px"})
    for (std::size_t i = 0; i < run.table.time_s.size(); ++i)
      if (run.table.time_s[i] >= from_s) max_px = std::max(max_px, std::abs(run.table.column(column).values[i]));
  Plot plot = time_plot("Errors: " + run.scenario.title, "error", "px",
                        {over_time(run.table, "error_r_px", "r", 0), over_time(run.table, "error_l_px", "l", 1),
                         over_time(run.table, "error_d_px", "d", 2)});
  plot.y.high = 1.1 * max_px;
  plot.y.low = -1.1 * max_px;
  return plot;
}

Table run_table(const TrackingResult& result) {
  Table table{"All runs; rms, mean and largest error over the last third, with the hidden marker from its return on",
              {"run", "latency [ms]", "estimated [ms]", "converged", "rms s [mrad]", "rms r, l, d [px]",
               "mean r, l, d [px]", "largest r, l, d [px]", "largest rate / limit"}};
  const auto three = [](const Eigen::Vector4d& v, bool sign) {
    return sign ? fmt::format("{:+.3f}, {:+.3f}, {:+.3f}", v[1], v[2], v[3])
                : fmt::format("{:.3f}, {:.3f}, {:.3f}", v[1], v[2], v[3]);
  };
  for (const TrackingRun& run : result.runs)
    table.rows.push_back({run.scenario.title, fmt::format("{:.0f}", 1000 * run.scenario.latency_s),
                          std::isfinite(run.delay_s) ? fmt::format("{:.0f}", 1000 * run.delay_s) : unknown_text,
                          converged_text(run), fmt::format("{:.3f}", 1000 * run.steady_rms[0]),
                          three(run.steady_rms, false), three(run.steady_mean, true), three(run.steady_largest, false),
                          fmt::format("{:.2f}", run.rate_fraction)});
  return table;
}

Table decay_table(const TrackingResult& result, const Eigen::Vector4d& gains_per_s) {
  Table table{
      "The paper\u2019s law: decay of each feature\u2019s error (eq. 22); \u2013 where it was small from the start",
      {"feature", "K [a period]", "K [1/s]", "Algorithm 1 [1/s]", "our tracker [1/s]"}};
  for (std::size_t k = 0; k < 4; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const auto decay = [i](const TrackingRun& run) { return decay_text(run.decay_per_s[i]); };
    table.rows.push_back({features[k].name, fmt::format("{:.4g}", gains_per_s[i] * tracking_period_s),
                          fmt::format("{:.3f}", gains_per_s[i]), text_of(result, "paper", decay),
                          text_of(result, "paper_surface", decay)});
  }
  return table;
}

std::string hold_text(const TrackingRun& run) {
  const auto text = [](const std::optional<double>& time_s) {
    return time_s ? fmt::format("{:.3f} s", *time_s) : std::string("never");
  };
  return fmt::format("{}, {}, {}", text(run.held_s), text(run.resumed_s), text(run.back_s));
}

std::vector<Comparison> comparisons(const TrackingResult& result, const Eigen::Vector4d& gains_per_s) {
  const auto rms = [](const TrackingRun& run) { return features_text(run.steady_rms); };
  const auto decay = [](const TrackingRun& run) { return decays_text(run.decay_per_s); };
  const auto with_our_tracker = [&](const TrackingRun& run) {
    return decay(run) + " (the paper\u2019s law, our tracker)";
  };
  std::vector<Comparison> rows{
      {"tracking: rms of the errors over the last third", "figure 7: \u201cconverge to zero\u201d",
       text_of(result, "paper", rms), text_of(result, "default", rms)},
      {"the paper\u2019s law with our tracker", "", "", text_of(result, "paper_surface", rms)},
      {"first within 1 px and 5 mrad for a second", "", text_of(result, "paper", converged_text),
       text_of(result, "default", converged_text)},
      {"decay of the errors of s, r, l, d by the paper\u2019s law", "K = " + decays_text(gains_per_s) + " (eq. 22)",
       text_of(result, "paper", decay), text_of(result, "paper_surface", with_our_tracker)},
      {"the same without knowing camera_from_rcm", "", "", text_of(result, "uncalibrated", converged_text)},
      {"marker hidden for 2 s: holds after, goes on after, close again after", "", "",
       text_of(result, "hidden", hold_text)},
      {"rms of the errors from the marker\u2019s return on", "", "", text_of(result, "hidden", rms)}};
  std::erase_if(rows, [](const Comparison& row) { return row.centerline.empty() && row.surface.empty(); });
  return rows;
}

std::vector<Figure> figures(const TrackingResult& result) {
  constexpr double settled_s = 5;
  std::vector<Figure> figures;
  const auto add = [&](const std::string& id, auto plot_of, const std::string& caption) {
    if (const TrackingRun* run = run_of(result, id)) figures.push_back({plot_of(*run), caption});
  };
  const auto errors = [](const TrackingRun& run) { return error_plot(run, settled_s); };
  for (const FeatureName& feature : features)
    figures.push_back(
        {figure_7(result, feature), &feature == features.data() ? "Figure 7: the errors, from a random start." : ""});
  for (const FeatureName& feature : features)
    add(
        "default", [&](const TrackingRun& run) { return feature_plot(run, feature); }, "");
  add("default", errors, "The first seconds leave the scale.");
  add("uncalibrated", errors, "First it moves each joint a little to learn what that does in the image.");
  if (const TrackingRun* hidden = run_of(result, "hidden"))
    figures.push_back(
        {errors(*hidden),
         fmt::format("Between {:.0f} and {:.0f} s nothing is seen: the arm holds, and the desired features stand.",
                     hidden->scenario.hidden_from_s.value_or(0), hidden->scenario.hidden_to_s.value_or(0))});
  return figures;
}

std::vector<std::string> notes(const TrackingResult& result, const Eigen::Vector4d& papers_per_s,
                               const Eigen::Vector4d& ours_per_s) {
  return {fmt::format("The paper gives neither K nor omega a unit of time. K per second would mean time constants of "
                      "{:.0f} s (s) to {:.0f} s (l) beside a swing of {:.1f} s; K is read per control period here "
                      "({:.0f} a second), omega per second.",
                      1 / (papers_per_s[0] * tracking_period_s), 1 / (papers_per_s[2] * tracking_period_s),
                      two_pi / paper_sinusoids().omega_rad_s[0], 1 / tracking_period_s),
          fmt::format("The paper\u2019s law takes the late image for the present. At its own gains (at most {:.2f} /s) "
                      "that makes s decay faster than K; at ours ({:.0f} /s) it would swing. The remaining errors of "
                      "r, l and d are the desired features\u2019 motion of that time.",
                      papers_per_s.maxCoeff(), ours_per_s.maxCoeff()),
          "Starts lie where the paper\u2019s law can lead home: on its way each feature has a pace of its own, and all "
          "four must be possible together (d is a fraction of l that the marker\u2019s bands limit).",
          "The default fuses the measured joints with the late image and estimates the delay by itself.",
          fmt::format(
              "The uncalibrated run goes by the RCM\u2019s image as estimated from 20 positions: {:.1f}, {:.1f} px.",
              result.estimated_rcm_px.x(), result.estimated_rcm_px.y())};
}

}  // namespace

ReportSection section_of(const TrackingResult& result, const ExperimentSetup& setup) {
  TrackingScenario papers, ours;
  papers.mode = ControlMode::paper;
  const Eigen::Vector4d papers_per_s = tracking_controller(papers, setup.rig.camera).gains.per_s,
                        ours_per_s = tracking_controller(ours, setup.rig.camera).gains.per_s;
  const SimulatorConfig simulated = tracking_simulator(ours, setup.seed);
  ReportSection section{"tracking", "Trajectory tracking (section V-D)"};
  section.text = {
      fmt::format("From a random start in the field of view the instrument follows {}, driven by what the simulated "
                  "endoscope sees: {:.0f} frames/s, {:.0f} ms late, with noise, jitter and lost frames; an arm with "
                  "lag, encoder steps, backlash, and measured joints that are {:.0f} mm and {:.0f} degrees off. All "
                  "errors are those of the true features.",
                  trajectory_text(), simulated.endoscope.frame_rate_hz, 1000 * simulated.endoscope.latency_s,
                  1000 * simulated.arm.joint_offset[2], deg_from_rad(simulated.arm.joint_offset[0]))};
  for (const std::string& title : result.missing)
    section.unfinished += (section.unfinished.empty() ? "Stopped. Missing: " : ", ") + title;
  if (!result.missing.empty()) section.unfinished += ".";
  section.comparisons = comparisons(result, papers_per_s);
  section.figures = figures(result);
  section.tables = {run_table(result), decay_table(result, papers_per_s)};
  section.notes = notes(result, papers_per_s, ours_per_s);
  section.command = "lapservo experiment tracking --out DIR" + setup.options;
  for (const TrackingRun& run : result.runs) section.files.push_back("tracking_" + run.scenario.id + ".csv");
  return section;
}

}  // namespace lapservo::internal
