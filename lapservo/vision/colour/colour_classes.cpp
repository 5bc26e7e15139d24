#include "lapservo/vision/colour/colour_classes.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/angles.h"

namespace lapservo::internal {

std::optional<double> hue_deg_of(double b, double g, double r) {
  const double highest = std::max({b, g, r}), chroma = highest - std::min({b, g, r});
  if (chroma < colour_limits.min_chroma || chroma < colour_limits.min_saturation * highest) return std::nullopt;
  if (highest == r) return 60 * (g - b) / chroma;
  if (highest == g) return 120 + 60 * (b - r) / chroma;
  return 240 + 60 * (r - g) / chroma;
}

ColourClasses::ColourClasses(const std::vector<Instrument>& instruments) {
  for (const Instrument& instrument : instruments) {
    std::array<std::uint8_t, 3> band_classes{};
    for (std::size_t band = 0; band < 3; ++band) {
      const double hue_deg = instrument.marker.hues_deg[band];
      auto same = std::find_if(hues_deg_.begin(), hues_deg_.end(), [&](double other_deg) {
        return hue_gap_deg(hue_deg, other_deg) < colour_limits.merge_deg;
      });
      if (same == hues_deg_.end()) same = hues_deg_.insert(hues_deg_.end(), hue_deg);
      band_classes[band] = static_cast<std::uint8_t>(1 + (same - hues_deg_.begin()));
    }
    bands_.push_back(band_classes);
  }

  std::vector<double> reach_deg(hues_deg_.size(), colour_limits.widest_reach_deg);
  for (std::size_t i = 0; i < hues_deg_.size(); ++i)
    for (std::size_t j = 0; j < hues_deg_.size(); ++j)
      if (i != j) reach_deg[i] = std::min(reach_deg[i], hue_gap_deg(hues_deg_[i], hues_deg_[j]) / 2);

  constexpr int levels = 1 << bits;
  table_.resize(static_cast<std::size_t>(levels) * levels * levels, 0);
  const auto centre = [](int level) { return (level + 0.5) * (1 << shift) - 0.5; };
  for (int b = 0; b < levels; ++b)
    for (int g = 0; g < levels; ++g)
      for (int r = 0; r < levels; ++r) {
        const auto hue_deg = hue_deg_of(centre(b), centre(g), centre(r));
        for (std::size_t i = 0; hue_deg && i < hues_deg_.size(); ++i)
          if (hue_gap_deg(*hue_deg, hues_deg_[i]) < reach_deg[i])
            table_[static_cast<std::size_t>(b << 2 * bits | g << bits | r)] = static_cast<std::uint8_t>(i + 1);
      }
}

}  // namespace lapservo::internal
