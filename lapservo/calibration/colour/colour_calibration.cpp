#include "lapservo/calibration/colour/colour_calibration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/colour/hue_faults.h"
#include "lapservo/calibration/colour/marker_light.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/core/spread.h"
#include "lapservo/core/statistics.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t min_colour_frames = 8, trial_frames = 8;
constexpr double reach_deg = 65;        // between an ink's hue and the rig's
constexpr double least_apart_deg = 40;  // between two bands: nearer, and each keeps no room for light and shade
constexpr double max_clipped = 0.3;     // of the marker's pixels: their hues are the sensor's, not the ink's
constexpr double least_move_m = 1.5e-3, least_turn_rad = 0.5;  // of the marker, rms: either
constexpr double max_sigma_deg = 12;                           // the largest that may be written

Rig with_hues(Rig rig, std::size_t instrument, const std::array<double, 3>& hues_deg) {
  for (Instrument& of : rig.instruments) of.camera_from_rcm.reset();
  Marker& marker = rig.instruments[instrument].marker;
  marker.hues_deg = hues_deg, marker.tolerance_m = std::max(marker.tolerance_m, uncalibrated_tolerance_m);
  return rig;
}

// Hues of what moves and has one: peaks of their histogram.
std::vector<double> moving_hues_deg(const std::vector<cv::Mat>& frames) {
  constexpr int bins = 72, every = 3, least_change = 60;
  constexpr double least_part = 0.01;
  std::array<double, bins> counts{};
  const std::size_t apart = std::max<std::size_t>(1, frames.size() / 2);
  const std::size_t step = std::max<std::size_t>(1, frames.size() / 12);
  for (std::size_t i = 0; i < frames.size(); i += step) {
    const cv::Mat &now = frames[i], &then = frames[(i + apart) % frames.size()];
    for (int v = 0; v < now.rows; v += every)
      for (int u = 0; u < now.cols; u += every) {
        const auto &p = now.at<cv::Vec3b>(v, u), &q = then.at<cv::Vec3b>(v, u);
        if (std::abs(p[0] - q[0]) + std::abs(p[1] - q[1]) + std::abs(p[2] - q[2]) < least_change) continue;
        if (const auto hue_deg = hue_deg_of(p[0], p[1], p[2]))
          counts[static_cast<std::size_t>(std::floor((*hue_deg + 360) / 360 * bins)) % bins] += 1;
      }
  }
  double total = 0;
  std::array<double, bins> smooth{};
  for (std::size_t i = 0; i < bins; ++i) {
    smooth[i] = counts[(i + bins - 1) % bins] + 2 * counts[i] + counts[(i + 1) % bins];
    total += smooth[i];
  }
  std::vector<double> peaks;
  for (std::size_t i = 0; i < bins; ++i) {
    const double before = smooth[(i + bins - 1) % bins], after = smooth[(i + 1) % bins];
    if (smooth[i] > before && smooth[i] >= after && smooth[i] > least_part * total)
      peaks.push_back((static_cast<double>(i) + 0.5) * 360 / bins);
  }
  return peaks;
}

int found_in(const Rig& rig, std::size_t instrument, const std::vector<cv::Mat>& frames, std::size_t every) {
  Tracker tracker(rig, {.single = true});
  int found = 0;
  for (std::size_t i = 0; i < frames.size(); i += every)
    found += tracker.track(frames[i])[instrument].status == Status::ok;
  return found;
}

// The rig's hues, and those of peaks near them, with which the marker is found most often.
std::array<double, 3> best_start(const Rig& rig, std::size_t instrument, const std::vector<cv::Mat>& frames) {
  const auto& known = rig.instruments[instrument].marker.hues_deg;
  const std::vector<double> peaks = moving_hues_deg(frames);
  std::array<std::vector<double>, 3> choices;
  for (std::size_t band = 0; band < 3; ++band) {
    choices[band].push_back(known[band]);
    for (const double peak : peaks)
      if (hue_gap_deg(peak, known[band]) < reach_deg) choices[band].push_back(peak);
  }
  const std::size_t every = std::max<std::size_t>(1, frames.size() / trial_frames);
  const auto trials = static_cast<int>((frames.size() + every - 1) / every);
  std::array<double, 3> best = known;
  int most = -1;
  for (const double a : choices[0])
    for (const double b : choices[1])
      for (const double c : choices[2]) {
        const std::array<double, 3> hues_deg{a, b, c};
        const double apart_deg = std::min({hue_gap_deg(a, b), hue_gap_deg(b, c), hue_gap_deg(a, c)});
        if (most == trials || apart_deg < least_apart_deg) continue;
        const int found = found_in(with_hues(rig, instrument, hues_deg), instrument, frames, every);
        if (found > most) most = found, best = hues_deg;
      }
  return best;
}

struct MeasuredHues {
  std::array<double, 3> hues_deg{}, sigma_deg{};
  std::vector<HueFault> faults;
  int found = 0;
  double clipped = 0, moved_m = 0, turned_rad = 0;
};

// With the marker where these hues find it.
MeasuredHues measure(const Rig& rig, std::size_t instrument, const std::vector<cv::Mat>& frames,
                     MarkerResponse* response) {
  const Marker& marker = rig.instruments[instrument].marker;
  Tracker tracker(rig, {.single = true});
  std::vector<FrameHues> hues;
  std::vector<double> clipped;
  std::vector<Eigen::Vector3d> places;
  Eigen::Vector2d turn = Eigen::Vector2d::Zero();  // sum of its directions
  MeasuredHues measured;
  for (const cv::Mat& frame : frames) {
    const Observation& seen = tracker.track(frame)[instrument];
    if (seen.status != Status::ok) continue;
    ++measured.found;
    const ShaftPose pose{seen.camera_from_unrolled, seen.psi_rad};
    places.push_back(pose.camera_from_unrolled.translation);
    turn += Eigen::Vector2d(std::cos(seen.tau_rad), std::sin(seen.tau_rad));
    if (response) response->add(frame, marker, pose);
    const auto light = light_of_marker(frame, rig.camera, marker, pose);
    if (!light) continue;
    clipped.push_back(light->clipped);
    hues.push_back(frame_hues(*light, marker));
  }
  measured.hues_deg = marker.hues_deg;
  if (clipped.empty()) return measured;
  measured.clipped = median(clipped);
  RecordedHues recorded = recorded_hues(hues);
  for (std::size_t band = 0; band < 3; ++band)
    measured.hues_deg[band] = std::fmod(marker.hues_deg[band] + recorded.beyond_deg[band] + 360, 360.0);
  measured.sigma_deg = recorded.sigma_deg, measured.faults = std::move(recorded.faults);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& place : places) mean += place / static_cast<double>(places.size());
  double squares = 0;
  for (const auto& place : places) squares += (place - mean).squaredNorm();
  measured.moved_m = std::sqrt(squares / static_cast<double>(places.size()));
  // Circular standard deviation.
  measured.turned_rad =
      std::sqrt(-2 * std::log(std::clamp(turn.norm() / static_cast<double>(places.size()), 1e-9, 1.0)));
  return measured;
}

std::string refusal_of(const MeasuredHues& measured, std::size_t frames, const std::string& name) {
  const auto& hues = measured.hues_deg;
  if (2 * static_cast<std::size_t>(measured.found) < frames)
    return fmt::format(
        "with the hues that suit best {} is in {} of {} frames: show it wholly, near, lit and in motion; the rig's "
        "hues_deg may be 60 degrees off, its diameter_m and bands half a millimetre",
        name, measured.found, frames);
  if (measured.clipped > max_clipped)
    return fmt::format(
        "{:.0f} % of the marker's pixels are saturated, which have the sensor's hue and not the ink's: lower the "
        "exposure",
        100 * measured.clipped);
  if (measured.moved_m < least_move_m && measured.turned_rad < least_turn_rad)
    return "the frames are all alike: move the instrument through the image and turn it, 10 s or more";
  const double apart_deg =
      std::min({hue_gap_deg(hues[0], hues[1]), hue_gap_deg(hues[1], hues[2]), hue_gap_deg(hues[0], hues[2])});
  if (apart_deg < least_apart_deg)
    return fmt::format(
        "two bands' hues are {:.0f} degrees apart, at least {:.0f} are needed: print with other inks, or look at the "
        "white balance",
        apart_deg, least_apart_deg);
  if (*std::max_element(measured.sigma_deg.begin(), measured.sigma_deg.end()) > max_sigma_deg)
    return "the hues are not those of one light: " + (measured.faults.empty()
                                                          ? "they scatter from frame to frame; light the marker evenly"
                                                          : measured.faults[0].text());
  return {};
}

}  // namespace

ColourCalibration calibrate_colour(const Rig& rig, std::size_t instrument, const std::vector<cv::Mat>& frames,
                                   bool keep_response, bool lossy, const JobWatch& watch) {
  ColourCalibration calibration;
  calibration.frames = frames.size();
  int step = 0;
  const auto progress = [&](const char* what) { watch.tell(std::nullopt, ++step, fmt::format(": {}", what)); };
  if (frames.size() < min_colour_frames)
    return calibration.refusal = fmt::format("{} frames, at least {} are needed", frames.size(), min_colour_frames),
           calibration;
  const Instrument& of = rig.instruments[instrument];
  progress("the rig's hues");
  calibration.found_before = found_in(with_hues(rig, instrument, of.marker.hues_deg), instrument, frames, 1);
  progress("which hues move");
  std::array<double, 3> hues_deg = best_start(rig, instrument, frames);
  MarkerResponse response(rig.camera);
  MeasuredHues measured;
  constexpr int rounds = 2;
  for (int round = 0; round < rounds; ++round) {
    progress("the bands' hues");
    measured =
        measure(with_hues(rig, instrument, hues_deg), instrument, frames, round + 1 == rounds ? &response : nullptr);
    hues_deg = measured.hues_deg;
  }
  calibration.refusal = refusal_of(measured, frames.size(), of.name);
  if (!calibration.refusal.empty()) return calibration;
  calibration.hues_deg = hues_deg, calibration.sigma_hues_deg = measured.sigma_deg;
  calibration.faults = values_of(measured.faults, &HueFault::text);
  progress("the response");
  if (const auto result = response.result()) {
    if (!keep_response) calibration.response = result->better;
    calibration.response_found =
        result->better && keep_response
            ? fmt::format(
                  "as it is: kept, though the marker alone says {}, which contradicts the board that measured it. {} "
                  "makes it so; where it does not, --replace-response takes the marker's",
                  result->name,
                  lossy ? "Compression, as of this recording, or a camera that sharpens" : "A camera that sharpens")
        : result->better
            ? fmt::format("{}: channels that rise at {} edges lie {:.3f} px from those that fall, {:.3f} px before",
                          result->name, result->edges, result->after_px, result->before_px)
            : fmt::format("as it is: no usual one brings channels nearer at {} edges, they lie {:.3f} px apart",
                          result->edges, result->before_px);
    constexpr double seen_sigmas = 3, least_px = 0.02;
    if (std::abs(result->left_px) > std::max(least_px, seen_sigmas * result->sigma_left_px))
      calibration.response_found += fmt::format(
          "; no usual one explains the edges, {:.3f} px are left beyond their noise: {}", std::abs(result->left_px),
          lossy           ? "the recording is compressed: record without losses or at a higher bit rate"
          : keep_response ? "switch the camera's sharpening off"
                          : "switch the camera's sharpening off, or lapservo calibrate camera");
  } else {
    calibration.response_found = "as it is: too few edges; come nearer";
  }
  Rig better = with_hues(rig, instrument, hues_deg);
  if (calibration.response) better.camera.response = *calibration.response;
  calibration.found = found_in(better, instrument, frames, 1);
  return calibration;
}

cv::Mat segmentation_picture(const cv::Mat& bgr, const Rig& rig) {
  const ColourClasses classes(rig.instruments);
  std::vector<cv::Vec3b> paints(static_cast<std::size_t>(classes.count()) + 1);
  for (std::size_t i = 0; i < rig.instruments.size(); ++i)
    for (std::size_t band = 0; band < 3; ++band) {
      cv::Mat paint(1, 1, CV_8UC3, cv::Scalar(rig.instruments[i].marker.hues_deg[band] / 2, 230, 255));
      cv::cvtColor(paint, paint, cv::COLOR_HSV2BGR);
      paints[classes.of_bands(i)[band]] = paint.at<cv::Vec3b>(0, 0);
    }
  cv::Mat picture;
  cv::cvtColor(bgr, picture, cv::COLOR_BGR2GRAY);
  cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
  picture *= 0.6;
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u)
      if (const auto colour = classes(bgr.ptr(v) + 3 * static_cast<std::ptrdiff_t>(u)))
        picture.at<cv::Vec3b>(v, u) = paints[colour];
  return picture;
}

ColourCalibration measure_colour(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 bool replace_response, const JobWatch& watch) {
  constexpr std::size_t most = 48;
  Spread<cv::Mat> kept(most);
  const bool live = recording.source.kind() == FrameSource::Kind::live;
  const FramesRead read = read_frames(recording, rig, live ? 10 : 1, watch, [&](const cv::Mat& bgr, double) {
    kept.add([&] { return bgr.clone(); });
    return fmt::format(", {} kept", kept.items().size());
  });
  ColourCalibration calibration;
  if (read.stopped) return calibration.refusal = "stopped", calibration;
  const bool is_named = recording.source.is_srgb();
  const bool keep_response = is_named || (!replace_response && rig.camera.response.sigma.has_value());
  calibration = calibrate_colour(rig, instrument, kept.items(), keep_response, read.lossy, watch);
  calibration.read = read;
  if (is_named) calibration.response_found = "as it is: the recording names how it encodes light";
  if (!calibration.refusal.empty() && 2 * calibration.found_before < static_cast<int>(calibration.frames)) {
    FrameDiagnosis diagnosis(rig);
    for (const cv::Mat& bgr : kept.items()) diagnosis.add(bgr, {});
    calibration.refusal += diagnosis.cause();
  }
  return calibration;
}

std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const ColourCalibration& calibration) {
  std::vector<CalibratedNumber> numbers;
  for (std::size_t i = 0; i < 3; ++i)
    numbers.push_back({fmt::format("hues_deg[{}] [deg]", i), before.hues_deg[i], calibration.hues_deg[i],
                       calibration.sigma_hues_deg[i]});
  return numbers;
}

Rig with_colour(Rig rig, std::size_t instrument, const ColourCalibration& calibration) {
  Marker& marker = rig.instruments[instrument].marker;
  marker.sigmas.hues_deg.emplace();
  for (std::size_t i = 0; i < 3; ++i) {
    marker.hues_deg[i] = std::round(100 * calibration.hues_deg[i]) / 100;
    (*marker.sigmas.hues_deg)[i] = rounded_sigma(calibration.sigma_hues_deg[i]);
  }
  if (calibration.response) rig.camera.response = *calibration.response, rig.camera_file.clear();
  return rig;
}

}  // namespace lapservo::internal
