#include "lapservo/calibration/colour/hue_faults.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "lapservo/core/departures.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t least_frames = 8, enough_frames = 48;
constexpr int frames_alike = 4;        // neighbours whose light and place err alike
constexpr double least_fault_deg = 2;  // smaller ones are not worth a word
constexpr double hue_floor_deg = 0.5;  // light, shade and white balance of the day

// Over the time and with the brightness, the range of each between -1/2 and 1/2. A hue lies as far from the middle of
// the time as at other times, rms, so that its sigma counts the motion.
Departures departures_from(const std::vector<FrameHues>& frames, const std::array<double, 3>& middle_deg) {
  const auto rows = 3 * static_cast<Eigen::Index>(frames.size());
  const auto [darkest, brightest] = std::ranges::minmax_element(frames, {}, &FrameHues::value);
  LinearFit fit;
  fit.alike_groups = frames_alike, fit.residuals.resize(rows);
  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(rows, 3), slopes = Eigen::MatrixXd::Zero(rows, 6);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const double time = (static_cast<double>(i) + 0.5) / static_cast<double>(frames.size()) - 0.5 - 1 / std::sqrt(12.0);
    const double light =
        (frames[i].value - (darkest->value + brightest->value) / 2) / std::max(1.0, brightest->value - darkest->value);
    fit.groups.push_back(3 * static_cast<Eigen::Index>(i));
    for (Eigen::Index band = 0; band < 3; ++band) {
      const Eigen::Index row = fit.groups.back() + band;
      fit.residuals[row] =
          middle_deg[static_cast<std::size_t>(band)] - frames[i].beyond_deg[static_cast<std::size_t>(band)];
      jacobian(row, band) = 1, slopes(row, band) = time, slopes(row, 3 + band) = light;
    }
  }
  fit.groups.push_back(rows), fit.jacobian = jacobian.sparseView();
  return departures_of(fit, slopes);
}

std::vector<HueFault> faults_of(const Departures& departures) {
  std::array<double, 2> most_deg{};  // over the time, with the brightness
  for (const Fault& fault : departures.seen)
    most_deg[fault.which / 3] = std::max(most_deg[fault.which / 3], std::abs(fault.size));
  std::vector<HueFault> faults;
  if (most_deg[0] > least_fault_deg)
    faults.push_back({most_deg[0], fmt::format("the hues move by {:.1f} degrees over the recording", most_deg[0]),
                      "fix the camera's white balance and exposure, let the light warm up"});
  if (most_deg[1] > least_fault_deg)
    faults.push_back(
        {most_deg[1],
         fmt::format("the hues change by {:.1f} degrees from the darkest frame to the brightest", most_deg[1]),
         "fix the camera's exposure and white balance, switch other lights off"});
  return faults;
}

}  // namespace

FrameHues frame_hues(const MarkerLight& light, const Marker& marker) {
  FrameHues hues{light.hues_deg, light.value};
  for (std::size_t band = 0; band < 3; ++band) hues.beyond_deg[band] -= marker.hues_deg[band];
  return hues;
}

RecordedHues recorded_hues(std::vector<FrameHues> frames) {
  frames = some_of(std::move(frames), enough_frames);
  RecordedHues recorded;
  std::array<double, 3> scatter_deg;
  for (std::size_t band = 0; band < 3; ++band) {
    auto beyond_deg = values_of(frames, [=](const FrameHues& frame) { return frame.beyond_deg[band]; });
    recorded.beyond_deg[band] = median(std::vector(beyond_deg));
    for (double& beyond : beyond_deg) beyond -= recorded.beyond_deg[band];
    scatter_deg[band] = robust_scale(beyond_deg) / std::sqrt(static_cast<double>(frames.size()) / frames_alike);
  }
  const Departures departures = departures_from(frames, recorded.beyond_deg);
  if (frames.size() >= least_frames) recorded.faults = faults_of(departures);
  for (std::size_t band = 0; band < 3; ++band) {
    const auto k = static_cast<Eigen::Index>(band);
    recorded.sigma_deg[band] = std::sqrt(hue_floor_deg * hue_floor_deg + std::pow(scatter_deg[band], 2) +
                                         departures.by_seen(k, k) + departures.by_instead(k, k));
  }
  return recorded;
}

}  // namespace lapservo::internal
