#include "lapservo/vision/colour/colour_classes.h"

#include <algorithm>

#include "lapservo/core/angles.h"

namespace lapservo::internal {

std::optional<double> hue_deg_of(double b, double g, double r) {
  const double highest = std::max({b, g, r}), chroma = highest - std::min({b, g, r});
  if (chroma < colour_limits.min_chroma || chroma < colour_limits.min_saturation * highest) return std::nullopt;
  constexpr double sixth_deg = whole_turn_deg / 6;
  if (highest == r) return sixth_deg * (g - b) / chroma;
  if (highest == g) return 2 * sixth_deg + sixth_deg * (b - r) / chroma;
  return 4 * sixth_deg + sixth_deg * (r - g) / chroma;
}

ColourClasses::ColourClasses(const std::vector<Instrument>& instruments) : bands_(instruments.size()) {
  struct Hue {
    double deg;
    std::uint8_t colour;
    double reach_deg = colour_limits.widest_reach_deg;
  };
  std::vector<Hue> hues;
  std::vector<double> first_deg;  // of each colour: hues count as alike by their first, so that they form no chains
  for (const Instrument& instrument : instruments)
    for (const double hue_deg : instrument.marker.hues_deg) {
      auto same = std::find_if(first_deg.begin(), first_deg.end(), [&](double other_deg) {
        return hue_gap_deg(hue_deg, other_deg) < colour_limits.merge_deg;
      });
      if (same == first_deg.end()) same = first_deg.insert(first_deg.end(), hue_deg);
      hues.push_back({hue_deg, static_cast<std::uint8_t>(1 + (same - first_deg.begin()))});
    }
  count_ = static_cast<int>(first_deg.size());
  for (std::size_t i = 0; i < hues.size(); ++i) bands_[i / 3][i % 3] = hues[i].colour;
  for (Hue& hue : hues)
    for (const Hue& other : hues)
      if (hue.colour != other.colour) hue.reach_deg = std::min(hue.reach_deg, hue_gap_deg(hue.deg, other.deg) / 2);

  constexpr int levels = 1 << bits;
  table_.resize(static_cast<std::size_t>(levels) * levels * levels, 0);
  const auto centre = [](int level) { return (level + 0.5) * (1 << shift) - 0.5; };
  for (int b = 0; b < levels; ++b)
    for (int g = 0; g < levels; ++g)
      for (int r = 0; r < levels; ++r) {
        const auto hue_deg = hue_deg_of(centre(b), centre(g), centre(r));
        if (!hue_deg) continue;
        for (const Hue& hue : hues)
          if (hue_gap_deg(*hue_deg, hue.deg) < hue.reach_deg)
            table_[static_cast<std::size_t>(b << 2 * bits | g << bits | r)] = hue.colour;
      }
}

}  // namespace lapservo::internal
