#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <map>
#include <optional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rcm/distinct_lines.h"
#include "lapservo/rcm/line_observation.h"
#include "lapservo/rcm/pairwise_mean.h"
#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {
using namespace internal;
namespace {

struct EstimateRcmOptions {
  std::string observations, rig, out;
  std::optional<double> sigma_px;  // else it is estimated
  double common_px = 0.01;
};

// An estimate of where an instrument's RCM appears in the image, in ideal pixels, by one of two methods.
struct RcmResult {
  std::string instrument, method;  ///< `method`: weighted or pairwise
  RcmEstimate estimate;            ///< of the pairwise mean: status, lines, point and covariance
  std::optional<double> noise_px, chi2, spread_rad;
  std::optional<Eigen::Vector2d> rig_px;  ///< the RCM by the rig's camera_from_rcm

  bool is_ok() const { return estimate.status == RcmStatus::ok; }
};

using LinesByInstrument = std::map<std::string, std::vector<LineObservation>>;

const Instrument* find_instrument(const std::optional<Rig>& rig, const std::string& name) {
  if (!rig) return nullptr;
  const auto index = instrument_index(*rig, name);
  return index ? &rig->instruments[*index] : nullptr;
}

Eigen::Vector2d read_ideal_point(const CsvTable& table, std::size_t row, const char* edge,
                                 const EstimateRcmOptions& options, const std::optional<Rig>& rig) {
  const double u_px = table.number(row, fmt::format("{}_u_px", edge));
  const double v_px = table.number(row, fmt::format("{}_v_px", edge));
  Eigen::Vector2d raw(u_px, v_px);
  if (!rig) return raw;
  const auto ideal = rig->camera.ideal_from_raw(raw);
  if (!ideal)
    throw InputError(options.observations, fmt::format("row {}: {}", row + 1, edge),
                     fmt::format("({:.1f}, {:.1f})", raw.x(), raw.y()),
                     "a pixel at which the camera of " + options.rig + " can be undistorted");
  return *ideal;
}

// Every instrument of the file has an entry, if only an empty one.
LinesByInstrument read_lines(const EstimateRcmOptions& options, const std::optional<Rig>& rig) {
  const CsvTable table = CsvTable::read(options.observations);
  LinesByInstrument lines;
  Progress progress(static_cast<int>(table.rows()));
  for (std::size_t row = 0; row < table.rows(); ++row) {
    progress.show(static_cast<int>(row) + 1, "");
    const std::string& name = table.text(row, "instrument");
    if (rig && !find_instrument(rig, name))
      throw InputError(options.observations, "instrument", name, "an instrument of " + options.rig);
    auto& own = lines[name];
    if (table.text(row, "status") != "ok") continue;
    const Eigen::Vector2d e0 = read_ideal_point(table, row, "e0", options, rig);
    const Eigen::Vector2d e3 = read_ideal_point(table, row, "e3", options, rig);
    own.push_back(line_between(e0, e3, options.sigma_px.value_or(1)));
  }
  return lines;
}

// The weighted total least squares without outliers. `sigma_px`: of both ends of a line, 0 to estimate it from the
// residuals; `common_px`: an error that all lines share.
RcmResult weighted_result(const std::vector<LineObservation>& lines, double sigma_px, double common_px) {
  const bool known = sigma_px > 0;
  RcmResult result;
  result.method = "weighted";
  RcmEstimate& estimate = result.estimate;
  estimate = estimate_projected_rcm(lines, {known ? NoiseScale::known : NoiseScale::estimated, common_px});
  if (!result.is_ok()) return result;
  if (known) result.chi2 = estimate.chi2;
  if (estimate.degrees_of_freedom > 0)
    result.noise_px = (known ? sigma_px : 1) * std::sqrt(estimate.chi2 / estimate.degrees_of_freedom);
  result.spread_rad = estimate.direction_spread_rad;
  return result;
}

// The paper's mean of all intersections (eq. 9); those of parallel lines are arbitrary.
RcmResult pairwise_result(const std::vector<LineObservation>& lines, const RcmResult& weighted) {
  RcmResult result;
  result.method = "pairwise";
  RcmEstimate& estimate = result.estimate;
  estimate.lines = static_cast<std::size_t>(std::count_if(lines.begin(), lines.end(), is_usable));
  const bool parallel = weighted.estimate.status == RcmStatus::parallel;
  const auto mean = parallel ? std::nullopt : mean_of_intersections(lines);
  estimate.status = mean ? RcmStatus::ok : estimate.lines < 2 ? RcmStatus::too_few_lines : RcmStatus::parallel;
  if (mean) estimate.point_px = mean->point_px, estimate.covariance_px2 = mean->covariance_px2;
  return result;
}

// CSV with a header and a row per result; absent values are empty.
void write_rcm_results(std::ostream& out, const std::vector<RcmResult>& results) {
  out << "instrument,method,status,lines,outliers,rcm_u_px,rcm_v_px,sigma_u_px,sigma_v_px,correlation,noise_px,"
         "chi2,direction_spread_rad,near_parallel,rig_u_px,rig_v_px,distance_px\n";
  for (const RcmResult& r : results) {
    const RcmEstimate& e = r.estimate;
    const auto point = r.is_ok() ? std::optional(e.point_px) : std::nullopt;
    const auto covariance = r.is_ok() ? e.covariance_px2 : std::nullopt;
    std::string row =
        fmt::format("{},{},{},{},{}", csv_field(r.instrument), r.method, to_string(e.status), e.lines, e.outliers);
    const auto add = [&](std::optional<double> value) { row += value ? fmt::format(",{:.6g}", *value) : ","; };
    const auto add_both = [&](const std::optional<Eigen::Vector2d>& of) {
      for (Eigen::Index i = 0; i < 2; ++i) add(of ? std::optional((*of)[i]) : std::nullopt);
    };
    add_both(point);
    const auto sigmas_px = covariance ? std::optional(covariance->diagonal().cwiseSqrt().eval()) : std::nullopt;
    add_both(sigmas_px);
    const double scale = covariance ? std::sqrt((*covariance)(0, 0) * (*covariance)(1, 1)) : 0;
    add(covariance ? std::optional(scale > 0 ? (*covariance)(0, 1) / scale : 0) : std::nullopt);
    add(r.noise_px), add(r.chi2), add(r.spread_rad);
    row += r.is_ok() && e.near_parallel ? ",1" : ",0";
    add_both(r.rig_px);
    add(point && r.rig_px ? std::optional((*point - *r.rig_px).norm()) : std::nullopt);
    out << row << '\n';
  }
}

std::vector<RcmResult> estimate_all(const EstimateRcmOptions& options, const std::optional<Rig>& rig) {
  std::vector<RcmResult> results;
  for (const auto& [name, rows] : read_lines(options, rig)) {
    const Instrument* instrument = find_instrument(rig, name);
    const std::vector<LineObservation> lines = distinct_lines(rows);
    if (lines.size() < rows.size())
      std::fprintf(stderr, "lapservo: note: %s: %zu rows of %zu positions that differ: a position counts once\n",
                   name.c_str(), rows.size(), lines.size());
    const RcmResult weighted = weighted_result(lines, options.sigma_px.value_or(0), options.common_px);
    for (RcmResult result : {weighted, pairwise_result(lines, weighted)}) {
      result.instrument = name;
      if (instrument && instrument->camera_from_rcm)
        result.rig_px = projected_rcm_px(rig->camera, *instrument->camera_from_rcm);
      results.push_back(std::move(result));
    }
  }
  return results;
}

void print(const RcmResult& r) {
  const RcmEstimate& e = r.estimate;
  const std::string head = fmt::format("{} {:<9}", r.instrument, r.method + ":");
  if (!r.is_ok()) {
    const char* why = e.status == RcmStatus::parallel ? ": turn the instrument farther between frames" : "";
    std::printf("%s none (%s, %zu lines%s)\n", head.c_str(), std::string(to_string(e.status)).c_str(), e.lines, why);
    return;
  }
  std::string line = fmt::format("({:.2f}, {:.2f}) px", e.point_px.x(), e.point_px.y());
  line += e.covariance_px2 ? fmt::format(", sigma ({:.2f}, {:.2f}) px", std::sqrt((*e.covariance_px2)(0, 0)),
                                         std::sqrt((*e.covariance_px2)(1, 1)))
                           : std::string(", sigma unknown");
  line += fmt::format(", {} lines", e.lines);
  if (r.method == "weighted") line += fmt::format(", {} of them outliers", e.outliers);
  if (r.noise_px) line += fmt::format(", noise {:.3f} px", *r.noise_px);
  if (r.chi2) line += fmt::format(", chi2 {:.1f} of {}", *r.chi2, e.lines - e.outliers - 2);
  if (r.rig_px) line += fmt::format("; {:.2f} px from the rig's", (e.point_px - *r.rig_px).norm());
  std::printf("%s %s\n", head.c_str(), line.c_str());
  for (const std::string& fault : e.faults)
    std::printf("%s: beyond the noise, counted in sigma: %s\n", r.instrument.c_str(), fault.c_str());
}

// Warns of lines that make the numbers unreliable.
void warn(const RcmResult& r) {
  constexpr double implausibly_small_px = 0.005;
  if (r.is_ok() && r.estimate.near_parallel)
    std::fprintf(stderr,
                 "lapservo: warning: %s: the lines are nearly parallel (their directions spread by %.1f degrees): the "
                 "estimate is poor along them; turn the instrument farther\n",
                 r.instrument.c_str(), r.spread_rad.value_or(0) * 180 / pi);
  if (3 * r.estimate.outliers > r.estimate.lines)
    std::fprintf(stderr,
                 "lapservo: warning: %s: %zu of %zu lines don't fit: --sigma-px is too small, or something else moved "
                 "(the port, the camera)\n",
                 r.instrument.c_str(), r.estimate.outliers, r.estimate.lines);
  if (r.noise_px && *r.noise_px < implausibly_small_px)
    std::fprintf(stderr,
                 "lapservo: warning: %s: the lines meet almost exactly: if they were tracked with camera_from_rcm in "
                 "the rig, this is only that; track with a rig that has none\n",
                 r.instrument.c_str());
}

int run(const EstimateRcmOptions& options) {
  std::optional<Rig> rig;
  if (!options.rig.empty()) rig = load_rig(options.rig);
  InputFiles inputs;
  inputs.add(options.observations);
  if (rig) inputs.add_rig(options.rig, *rig);
  inputs.refuse_as_output(options.out);
  refuse_other_kind(options.out, ".csv");
  std::optional<AtomicFile> report;
  if (!options.out.empty()) report.emplace(options.out);
  const std::vector<RcmResult> results = estimate_all(options, rig);
  if (report) {
    write_rcm_results(report->stream(), results);
    report->commit();
  }
  for (const RcmResult& result : results) {
    print(result);
    warn(result);
  }
  if (!rig) std::fprintf(stderr, "lapservo: note: without --rig the lens is taken to have no distortion\n");
  if (!options.out.empty()) std::printf("report: %s\n", options.out.c_str());
  if (std::any_of(results.begin(), results.end(), [](const RcmResult& r) { return r.is_ok(); })) return 0;
  std::fprintf(stderr, "lapservo: no RCM was estimated: it takes two observations or more, in different directions\n");
  return 1;
}

}  // namespace

void add_estimate_rcm(Command app) {
  auto [command, options] = app.add_subcommand<EstimateRcmOptions>(
      "estimate-rcm", "Estimate where the RCM appears in the image, from the lines on which the instrument was seen.",
      run);
  command.add_option("observations", options.observations, required(),
                     "CSV of `lapservo track`, with a rig that has no camera_from_rcm (else it only repeats that one)");
  command.add_option("--rig", options.rig,
                     "To undistort the lines, and to compare with its camera_from_rcm where it has one");
  command.add_option("--out", options.out, "CSV to write or replace: a row per instrument and method, in ideal pixels");
  command.add_option(
      "--sigma-px", options.sigma_px, between(1e-6, 1000.0),
      "Standard deviation of e0 and e3 in either coordinate; else estimated from how badly the lines meet");
  command.add_option("--common-px", options.common_px, between(0.0, 1000.0),
                     "Standard deviation of an error across the lines that all of them share and no number of lines "
                     "averages out; the default is that of `lapservo track` behind a well calibrated lens");
  command.footer(
      "Prints two estimates: weighted, by total least squares without outliers, and pairwise, the paper's mean of all\n"
      "intersections, with one standard deviation each. Lines should come from positions of the instrument that "
      "differ:\n"
      "many frames of one position count as one line.\n"
      "Example:\n  lapservo track frames --rig camera_and_marker.yaml --single --out obs.csv\n"
      "  lapservo estimate-rcm obs.csv --rig camera_and_marker.yaml --out rcm.csv");
}

}  // namespace lapservo::app
