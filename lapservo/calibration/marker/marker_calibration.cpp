#include "lapservo/calibration/marker/marker_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "lapservo/calibration/marker/print_adjustment.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {
namespace {

constexpr int sectors = 60;
constexpr std::size_t max_per_sector = 2;

constexpr std::size_t min_edges = 40, min_turn_frames = 12, min_seam_views = 3;
constexpr double widest_unseen_rad = 0.9;  // between neighbouring facing azimuths; a view measures +-0.9 rad
// Blur as a fraction of the diameter's image. At 0.01 contours lie within 0.05 px, at 0.024 (--blur-px 2.2) 0.8 px
// inside, and all lengths with them.
constexpr double max_blur_diameters = 0.02;
constexpr int max_rounds = 16, gap_round = 7;
constexpr double settled_m = 1e-6;
// Largest tolerance of a print that may be written: with more, psi is hardly ever known.
constexpr double max_tolerance_m = 0.1e-3;
// A gap narrower than least_edge_m, or than three sigma, is none.
constexpr double min_gap_sigmas = 3;

// Search range of boundaries and the seam about a round's estimate, and the weight of an outlier.
struct Round {
  double reach_m, seam_reach_m, loss_scale_sigmas;
  bool ask_processing = false;  // which wants edges that are located
};
constexpr std::array rounds{Round{0.6e-3, 2.0e-3, 60}, Round{0.4e-3, 1.2e-3, 20}, Round{0.2e-3, 0.6e-3, 6, true},
                            Round{0.1e-3, 0.4e-3, 2.5, true}};

// The marker's other azimuths face the camera as it turns; farther than so from one frame to the next it jumped.
double turn_between(double before_tau_rad, double tau_rad) {
  constexpr double farthest_turn_rad = 0.6;
  const double turned_rad = wrap_pi(before_tau_rad - tau_rad);
  return std::abs(turned_rad) < farthest_turn_rad ? turned_rad : 0;
}

// Sharper is better, and a pose that settled best.
double worth(const Sighting& sighting) {
  return (sighting.settled ? 100 : 0) - sighting.blur.boundaries_px() - sighting.blur.sides_px;
}

// Whether a frame determines a pose by itself: with one boundary and the contours a roll and a shift along the shaft
// look alike, and both ends do not determine the roll. With one such frame the print has no covariance.
bool tells_pose(const EdgeMeasurements& edges) {
  constexpr int min_lines = 5, min_boundaries = 2;
  std::array<int, 4> lines{};
  for (const Measurement& m : edges.all)
    if (m.group < lines.size()) ++lines[m.group];
  const auto seen = std::count_if(lines.begin(), lines.end(), [](int of_one) { return of_one >= min_lines; });
  return seen >= min_boundaries && std::max(lines[1], lines[2]) >= min_lines;
}

// The frames and the print while they are being fitted.
class TurnFit {
 public:
  TurnFit(const Rig& rig, std::size_t instrument, std::vector<KeyFrame> frames, AtIteration at_iteration)
      : measurer_(rig, instrument),
        marker_(rig.instruments[instrument].marker),
        frames_(std::move(frames)),
        at_iteration_(std::move(at_iteration)) {
    // Where it does not settle, a coarse pose is good enough to start from: the rounds look far.
    for (auto& [view, sighting, time_s, turned_rad] : frames_)
      if (!sighting.settled) sighting = measurer_.settled(view, marker_, sighting).value_or(sighting);
  }

  const Marker& marker() const { return marker_; }
  const std::vector<KeyFrame>& frames() const { return frames_; }
  std::vector<KeyFrame> take_frames() { return std::move(frames_); }
  const std::vector<ViewMeasurements>& measured() const { return measured_; }
  void believe_no_gap() { marker_.gap_rad = 0, free_gap_ = false; }

  // Measures and adjusts once. Nullopt when it can't be solved.
  std::optional<Adjustment> round(const Round& how, bool free_print, bool with_covariance = false) {
    measured_.clear();
    std::erase_if(frames_, [&](const KeyFrame& frame) {
      const Eigen::Vector3d place = frame.sighting.unknowns.pose().camera_from_unrolled.translation;
      const double px_per_m = frame.view.camera.fx_px / std::max(place.z(), 1e-3);
      const double extra_px = std::clamp(how.reach_m * px_per_m, 2.0, 15.0);
      auto measured = measurer_.measure(frame.view, marker_, frame.sighting,
                                        {extra_px, how.seam_reach_m, free_gap_, how.ask_processing, only_video_});
      if (measured.edges.all.size() < min_edges) return true;  // too few for a pose
      if (with_covariance && !tells_pose(measured.edges)) return true;
      measured.turned_rad = frame.turned_rad, measured.time_s = frame.time_s;
      measured_.push_back(std::move(measured));
      return false;
    });
    if (frames_.empty()) return std::nullopt;
    take_processing_off(measured_);
    auto adjustment =
        adjust(measured_, marker_, {how.loss_scale_sigmas, free_print, free_gap_, with_covariance}, at_iteration_);
    if (!adjustment) return std::nullopt;
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      Sighting& sighting = frames_[i].sighting;
      const UnknownVector& step = adjustment->steps[i];
      sighting.unknowns = sighting.unknowns.changed_by(step.head<pose_unknowns>());
      sighting.film_m =
          std::clamp(sighting.film_m + film_sigma_m * step[film_unknown], 0.0, film_mean_m + 4 * film_sigma_m);
      sighting.blur = measured_[i].edges.improved(sighting.blur);
    }
    if (free_print) {
      PrintShape shape = changed_by(PrintShape::of(marker_), adjustment->print);
      shape.gap_rad = std::clamp(shape.gap_rad, 0.0, 1.2);
      marker_ = shape.on(marker_);
    }
    return adjustment;
  }

  // Tests some measured frames: whether their camera is plain except for a video's compression.
  void judge_video() {
    constexpr std::size_t asked = 24;
    if (frames_.empty() || ChannelGeometry(frames_[0].view.camera).differs()) return;
    std::vector<ViewMeasurements> any, only_video;
    for (std::size_t i = 0; i < frames_.size(); i += 1 + frames_.size() / asked) {
      if (measured_[i].processing.processing == Processing::unknown) continue;
      const KeyFrame& frame = frames_[i];
      any.push_back(measurer_.measure(frame.view, marker_, frame.sighting, {2, 0.2e-3, free_gap_, true, false}));
      only_video.push_back(measurer_.measure(frame.view, marker_, frame.sighting, {2, 0.2e-3, free_gap_, true, true}));
    }
    only_video_ = shows_only_video(any, only_video);
  }

  // Forgets frames whose boundaries agree much worse than others' do: a wrong pose, something in front.
  void drop_misfits(const Adjustment& adjustment) {
    std::vector<double> scatters;  // medians of the frames' residuals, in sigmas
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      std::vector<double> sigmas;
      for (std::size_t k = 0; k < adjustment.residuals_px[i].size(); ++k)
        sigmas.push_back(std::abs(adjustment.residuals_px[i][k]) / measured_[i].edges.all[k].sigma_px);
      scatters.push_back(median(sigmas));
    }
    const double limit = 3 * median(std::vector(scatters)) + 0.5;
    std::size_t i = 0;
    std::erase_if(frames_, [&](const KeyFrame&) { return !(scatters[i++] < limit); });
  }

 private:
  ViewMeasurer measurer_;
  Marker marker_;
  std::vector<KeyFrame> frames_;
  AtIteration at_iteration_;
  std::vector<ViewMeasurements> measured_;
  bool free_gap_ = true, only_video_ = false;
};

// The widest stretch of azimuths from which no frame faces the marker.
double widest_unseen(const std::vector<KeyFrame>& frames, const Marker& marker) {
  std::vector<double> taus_rad;
  for (const KeyFrame& frame : frames)
    if (const auto tau_rad = facing_tau_rad(marker, frame.sighting.unknowns.pose())) taus_rad.push_back(*tau_rad);
  if (taus_rad.empty()) return two_pi;
  std::sort(taus_rad.begin(), taus_rad.end());
  double widest = two_pi - taus_rad.back() + taus_rad.front();
  for (std::size_t i = 1; i < taus_rad.size(); ++i) widest = std::max(widest, taus_rad[i] - taus_rad[i - 1]);
  return widest;
}

std::size_t seam_views(const std::vector<ViewMeasurements>& measured) {
  return static_cast<std::size_t>(std::ranges::count_if(
      measured, [](const ViewMeasurements& m) { return m.seam && (m.seam->upper || m.seam->lower); }));
}

// Whether most frames are too blurred; empty when they are not. Only the rounds show it for a frame that did not
// settle.
std::string blur_refusal(const std::vector<KeyFrame>& frames, const Marker& marker) {
  const auto blurred = std::count_if(frames.begin(), frames.end(), [&](const KeyFrame& frame) {
    const double depth_m = frame.sighting.unknowns.pose().camera_from_unrolled.translation.z();
    // Defocus and motion widen all boundaries; a camera's filters those between two colours.
    const auto& along_px = frame.sighting.blur.along_px;
    return *std::min_element(along_px.begin(), along_px.end()) >
           max_blur_diameters * marker.diameter_m * frame.view.camera.fx_px / depth_m;
  });
  if (2 * static_cast<std::size_t>(blurred) <= frames.size()) return {};
  return fmt::format(
      "{} of {} frames are too blurred (by more than {:.0f} % of the shaft's width): focus, turn more slowly, or come "
      "nearer",
      blurred, frames.size(), 100 * max_blur_diameters);
}

// The reason why these frames do not determine the print; empty when they do.
std::string refusal_of(const std::vector<KeyFrame>& frames, const Marker& marker) {
  if (frames.size() < min_turn_frames)
    return fmt::format(
        "{} frames show the marker wholly, from different sides, and at least {} are needed: film a slow full turn "
        "about the shaft's axis, the whole marker in view",
        frames.size(), min_turn_frames);
  if (const double unseen_rad = widest_unseen(frames, marker); unseen_rad > widest_unseen_rad)
    return fmt::format(
        "the marker is not seen from all sides ({:.0f} of 360 degrees are missing): film a slow full turn about the "
        "shaft's axis",
        deg_from_rad(unseen_rad));
  return blur_refusal(frames, marker);
}

// Whether the last round moved every number by little: by a micrometre, or by a fraction of its sigma, within which
// noisy edges come and go.
bool is_settled(const Adjustment& adjustment, double radius_m) {
  constexpr double of_sigma = 0.3;
  for (int i = 0; i < print_numbers; ++i) {
    const double unit_m = i == print_numbers - 1 ? radius_m : 1;
    const double sigma_m = unit_m * std::sqrt((*adjustment.covariance)(i, i));
    if (std::abs(unit_m * adjustment.print[i]) > std::max(settled_m, of_sigma * sigma_m)) return false;
  }
  return true;
}

// A sentence for each kind, the clearest first.
std::vector<std::string> texts_of(const std::vector<PrintFault>& faults, double first_s) {
  std::vector<std::string> texts;
  std::set<PrintFault::Kind> told;
  for (const PrintFault& fault : faults) {
    if (!told.insert(fault.kind).second) continue;
    const double size_mm = 1e3 * std::abs(fault.size);
    texts.push_back(
        fault.kind == PrintFault::Kind::slips
            ? fmt::format("the print slips by {:.3f} mm about {:.0f} s after the start: fasten it and record again",
                          size_mm, fault.from_s - first_s)
            : fmt::format("a boundary of the print bows by {:.3f} mm between its ends: print and cut it straight",
                          size_mm));
  }
  return texts;
}

struct ResidualSummary {
  double rms_px = 0;
  std::vector<PrintResidual> residuals;
};

// Range of the boundaries; anything beyond five sigma and a print's errors is no boundary.
ResidualSummary summary_of(const Adjustment& adjustment, const std::vector<ViewMeasurements>& measured,
                           const Marker& marker, double max_px) {
  ResidualSummary summary;
  double squares = 0;
  for (std::size_t i = 0; i < measured.size(); ++i)
    for (std::size_t k = 0; k < adjustment.residuals_px[i].size(); ++k) {
      const Measurement& m = measured[i].edges.all[k];
      const double residual_px = adjustment.residuals_px[i][k];
      if (m.group >= 4 || std::abs(residual_px) > max_px) continue;
      squares += residual_px * residual_px;
      summary.residuals.push_back({m.group, m.turn_fraction * marker.covered_rad(), residual_px / m.along_px_per_m});
    }
  if (!summary.residuals.empty()) summary.rms_px = std::sqrt(squares / static_cast<double>(summary.residuals.size()));
  return summary;
}

MarkerCalibration refused(std::string why, bool contradicts = false) {
  MarkerCalibration calibration;
  calibration.refusal = std::move(why), calibration.contradicts = contradicts;
  return calibration;
}

}  // namespace

KeyFrames::KeyFrames(const Rig& rig, std::size_t instrument)
    : rig_(rig), instrument_(instrument), survey_(rig, instrument), sectors_(2 * sectors) {}

bool KeyFrames::add(const cv::Mat& bgr, double time_s) {
  const auto sighting = survey_.find(bgr);
  const auto before_rad = std::exchange(last_tau_rad_, std::nullopt);
  if (!sighting) return false;
  ++found_;
  last_tau_rad_ = sighting->tau_rad;
  const double turned_rad = before_rad ? turn_between(*before_rad, sighting->tau_rad) : 0;
  const double at = std::min(sectors - 1.0, wrap_two_pi(sighting->tau_rad) / two_pi * sectors);
  auto& sector = sectors_[static_cast<std::size_t>(at) + (turned_rad < 0 ? sectors : 0)];
  auto worst = sector.end();
  if (sector.size() >= max_per_sector) {
    worst = std::ranges::min_element(sector, {}, [](const KeyFrame& frame) { return worth(frame.sighting); });
    if (worth(worst->sighting) >= worth(*sighting)) return true;
  }
  const Marker& marker = rig_.instruments[instrument_].marker;
  auto view = cropped_view(bgr, rig_.camera, marker, sighting->unknowns.pose().camera_from_unrolled);
  if (!view) return true;
  KeyFrame frame{std::move(*view), *sighting, time_s, turned_rad};
  if (worst == sector.end())
    sector.push_back(std::move(frame));
  else
    *worst = std::move(frame);
  return true;
}

std::vector<KeyFrame> KeyFrames::take() {
  std::vector<KeyFrame> frames;
  for (auto& sector : sectors_) {
    for (KeyFrame& frame : sector) frames.push_back(std::move(frame));
    sector.clear();
  }
  return frames;
}

MarkerCalibration calibrate_marker(const Rig& rig, std::size_t instrument, std::vector<KeyFrame> frames,
                                   const JobWatch& watch) {
  const Marker nominal = rig.instruments[instrument].marker;
  if (const std::string why = refusal_of(frames, nominal); !why.empty()) return refused(why);
  double first_s = frames.front().time_s;
  for (const KeyFrame& frame : frames) first_s = std::min(first_s, frame.time_s);
  const std::string unsolvable = "the frames contradict one another: is it one marker, and the rig's camera?";
  TurnFit fit(rig, instrument, std::move(frames), watch.is_stopped);
  MarkerCalibration calibration;

  // The rig's print first, to start the poses and to measure its residuals.
  constexpr double max_before_px = 20;
  auto before = fit.round(rounds[0], false);
  if (before) before = fit.round(rounds[0], false);
  if (!before) return refused(unsolvable, true);
  const ResidualSummary residuals_before = summary_of(*before, fit.measured(), nominal, max_before_px);
  calibration.before_px = residuals_before.rms_px, calibration.before = residuals_before.residuals;

  std::optional<Adjustment> last;
  bool settled = false, gap_judged = false;
  std::optional<double> no_gap_sigma_rad;
  for (int i = 0; i < max_rounds && !settled; ++i) {
    watch.tell(std::nullopt, i, fmt::format(" of at most {} rounds of fitting", max_rounds));
    const auto stage = std::min(static_cast<std::size_t>(i), rounds.size() - 1);
    last = fit.round(rounds[stage], true, stage + 1 == rounds.size());
    if (!last) return refused(unsolvable, true);
    if (i == 2) fit.judge_video();
    if (fit.frames().size() < min_turn_frames) return refused(refusal_of(fit.frames(), nominal));
    if (i >= 2) fit.drop_misfits(*last);
    if (fit.frames().size() < min_turn_frames) return refused(unsolvable, true);
    settled = last->covariance && is_settled(*last, nominal.radius_m());
    if (gap_judged || !(settled || i == gap_round)) continue;
    // A gap that is insignificant counts as none: then the print's ends meet in one edge.
    gap_judged = true;
    const double gap_m = fit.marker().gap_rad * nominal.radius_m();
    const double sigma_m = std::sqrt((*last->covariance)(print_numbers - 1, print_numbers - 1)) * nominal.radius_m();
    if (gap_m >= std::max(least_edge_m, min_gap_sigmas * sigma_m)) continue;
    no_gap_sigma_rad = sigma_m / nominal.radius_m();
    fit.believe_no_gap(), settled = false;
  }
  last = fit.round(rounds.back(), true, true);
  if (!last) return refused(unsolvable, true);
  if (const std::string why = blur_refusal(fit.frames(), nominal); !why.empty()) return refused(why);
  calibration.seam_views = seam_views(fit.measured());
  calibration.seam_may_lag = last->lags;
  if (calibration.seam_views < min_seam_views)
    return refused(
        "the seam is not visible well enough to locate the beginning of the print: film it slowly passing the camera, "
        "without glare");
  if (!settled) return refused("the fit does not settle: more frames, sharper ones, or a rig nearer to the print");
  calibration.after_px = summary_of(*last, fit.measured(), fit.marker(), 2).rms_px;
  calibration.faults = texts_of(last->faults, first_s);
  calibration.marker = fit.marker();
  calibration.marker.sigmas = sigmas_of(*last->covariance, nominal.sigmas);
  if (no_gap_sigma_rad) calibration.marker.sigmas.gap_rad = no_gap_sigma_rad;
  calibration.marker.tolerance_m = tolerance_of(PrintShape::of(fit.marker()), *last->covariance, fit.marker());
  if (calibration.marker.tolerance_m > max_tolerance_m)
    return refused(
        fmt::format(
            "its boundaries would be known to {:.2f} mm only: {}", 1e3 * calibration.marker.tolerance_m,
            calibration.faults.empty() ? "turn it more slowly, nearer and sharper" : calibration.faults.front()),
        !calibration.faults.empty());
  if (const auto problem = marker_problem(calibration.marker))
    return refused("what was found is no marker: " + problem->text());
  if (const std::string problem = decoding_problem(calibration.marker); !problem.empty())
    return refused("what was found can't be decoded: " + problem);
  calibration.key_frames = fit.take_frames();
  calibration.frames = calibration.key_frames.size();
  return calibration;
}

}  // namespace lapservo::internal
