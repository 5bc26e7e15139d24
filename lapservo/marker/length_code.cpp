#include "lapservo/marker/length_code.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "lapservo/core/angles.h"
#include "lapservo/marker/decoder.h"

namespace lapservo::internal {
namespace {

constexpr double min_change = 1e-6;  // of the marker's length: less is rounding

double change_m(const Marker& marker, std::size_t band) {
  return marker.bands_lower_m.at(band) - marker.bands_upper_m.at(band);
}

// Boundaries in the image along the shaft's line, px from the proximal end's.
std::array<double, 4> imaged_px(const Marker& marker, double tau_rad, const Viewing& viewing, double inclination_rad) {
  auto e = boundaries_m(marker, tau_rad);
  for (double& along : e)
    along =
        viewing.focal_px * along * std::cos(inclination_rad) / (viewing.distance_m + along * std::sin(inclination_rad));
  return e;
}

}  // namespace

std::string length_decoding_problem(const Marker& marker, std::size_t band) {
  if (std::abs(change_m(marker, band)) > min_change * marker.length_m()) return {};
  return "band " + std::to_string(band) + " is as long at every rotation: one of its boundaries must slope";
}

LengthDecoder::LengthDecoder(const Marker& marker, std::size_t band)
    : upper_m_(marker.bands_upper_m.at(band)),
      lower_m_(marker.bands_lower_m.at(band)),
      covered_rad_(marker.covered_rad()) {
  if (const std::string problem = length_decoding_problem(marker, band); !problem.empty())
    throw std::invalid_argument(problem);
}

double LengthDecoder::tau_rad(double length_m) const {
  if (!std::isfinite(length_m)) return std::numeric_limits<double>::quiet_NaN();
  return covered_rad_ * std::clamp((length_m - upper_m_) / (lower_m_ - upper_m_), 0.0, 1.0);
}

std::size_t most_telling_band(const Marker& marker) {
  std::size_t best = 0;
  for (std::size_t band = 1; band < 3; ++band)
    if (std::abs(change_m(marker, band)) > std::abs(change_m(marker, best))) best = band;
  return best;
}

double predicted_sigma_length_rad(const Marker& marker, std::size_t band, const Viewing& viewing) {
  const double sigma_m = std::sqrt(2.0) * viewing.sigma_edge_px / viewing.px_per_m();
  return marker.covered_rad() * sigma_m / std::abs(change_m(marker, band));
}

CodeErrors perspective_errors(const Marker& marker, std::size_t band, double tau_rad, const Viewing& viewing,
                              const ViewingError& viewing_error) {
  const auto e_px = imaged_px(marker, tau_rad, viewing, viewing_error.inclination_rad);
  const double believed_px_per_m = viewing.px_per_m() / (1 + viewing_error.depth_fraction);
  CodeErrors errors;
  errors.by_length_rad =
      LengthDecoder(marker, band).tau_rad((e_px.at(band + 1) - e_px.at(band)) / believed_px_per_m) - tau_rad;
  errors.by_cross_ratio_rad = std::numeric_limits<double>::quiet_NaN();
  if (decoding_problem(marker).empty()) {
    const double ratio = cross_ratio(e_px[1] - e_px[0], e_px[2] - e_px[1], e_px[3] - e_px[2]);
    errors.by_cross_ratio_rad = CrossRatioDecoder(marker).tau_rad(ratio) - tau_rad;
  }
  return errors;
}

}  // namespace lapservo::internal
