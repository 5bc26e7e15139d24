#include "lapservo/calibration/check/other_bands.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include <fmt/format.h>

#include "lapservo/marker/band_shares.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

// On the line that faces the camera.
std::optional<BandShares> shares_in(const Observation& observation) {
  using What = Observation::Refused::What;
  const bool is_ok = observation.status == Status::ok;
  if (!is_ok && observation.refused.what != What::edges) return std::nullopt;
  const auto& edges = is_ok ? observation.edges_raw_px : observation.refused.edges_raw_px;
  const double length_px = (edges[3] - edges[0]).norm();
  BandShares shares{};
  for (std::size_t i = 0; i < shares.size(); ++i) shares[i] = (edges[i + 1] - edges[i]).norm() / length_px;
  return shares;
}

// "3.5 to 17.0", of the shortest and the longest.
std::string range_mm(double a_m, double b_m) {
  const auto [low, high] = std::minmax(1000 * a_m, 1000 * b_m);
  return high - low < 0.1 ? fmt::format("{:.1f}", low) : fmt::format("{:.1f} to {:.1f}", low, high);
}

std::string text_of(const Marker& marker, const std::vector<BandShares>& seen) {
  std::array<std::string, 3> seen_mm, rig_mm;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto [low, high] = std::minmax_element(seen.begin(), seen.end(),
                                                 [i](const BandShares& a, const BandShares& b) { return a[i] < b[i]; });
    seen_mm[i] = range_mm((*low)[i] * marker.length_m(), (*high)[i] * marker.length_m());
    rig_mm[i] = range_mm(marker.bands_upper_m[i], marker.bands_lower_m[i]);
  }
  return fmt::format(
      "the rig's colours are found in their order, but its bands do not fit: if the print is {:.1f} mm long, as in the "
      "rig, they are {}, {} and {} mm long where they face the camera, in the rig {}, {} and {} mm: write the print's "
      "bands_upper_m and bands_lower_m into the rig",
      1000 * marker.length_m(), seen_mm[0], seen_mm[1], seen_mm[2], rig_mm[0], rig_mm[1], rig_mm[2]);
}

}  // namespace

std::string seen_other_bands(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced) {
  const auto is_readable = [](const Instrument& instrument) { return decoding_problem(instrument.marker).empty(); };
  if (!std::all_of(rig.instruments.begin(), rig.instruments.end(), is_readable)) return "";
  std::vector<std::vector<BandShares>> others(rig.instruments.size());
  for (const cv::Mat& frame : frames) {
    const auto observations = Tracker(rig, {.method = Method::centerline, .deinterlace = deinterlaced}).track(frame);
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const auto seen = shares_in(observations[i]);
      if (seen && !has_band_shares(rig.instruments[i].marker, *seen)) others[i].push_back(*seen);
    }
  }
  for (std::size_t i = 0; i < others.size(); ++i)
    if (2 * others[i].size() > frames.size()) return text_of(rig.instruments[i].marker, others[i]);
  return "";
}

}  // namespace lapservo::internal
