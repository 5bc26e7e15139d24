#include "lapservo/vision/search/line_segmentation.h"

#include <algorithm>
#include <vector>

namespace lapservo::internal {
namespace {

constexpr std::size_t states = 5;  // shaft, band 0, 1, 2, shaft

// The least on each side of a boundary to count as seen.
bool supported(std::span<const std::uint8_t> classes, std::size_t boundary, std::size_t k,
               const std::array<std::uint8_t, 3>& bands) {
  constexpr std::size_t reach = 4, needed = 3;
  if (boundary < reach || boundary + reach > classes.size()) return false;
  const std::uint8_t before = k == 0 ? 0 : bands[k - 1];
  const std::uint8_t after = k == 3 ? 0 : bands[k];
  const auto at = classes.begin() + static_cast<std::ptrdiff_t>(boundary);
  return std::count(at - reach, at, before) >= static_cast<std::ptrdiff_t>(needed) &&
         std::count(at, at + reach, after) >= static_cast<std::ptrdiff_t>(needed);
}

// line_reward() in a table: the colours that it separates, and what each gains in every state.
class Rewards {
 public:
  explicit Rewards(const std::array<std::uint8_t, 3>& bands) {
    constexpr std::uint8_t another = Scene::outside - 1;
    const std::array<std::uint8_t, 6> colours{another, 0, Scene::outside, bands[0], bands[1], bands[2]};
    kind_.fill(0);
    for (std::size_t kind = 0; kind < colours.size(); ++kind) {
      kind_[colours[kind]] = static_cast<std::uint8_t>(kind);
      for (std::size_t state = 0; state < states; ++state)
        of_kind_[kind][state] = line_reward(state, colours[kind], bands);
    }
  }
  const std::array<float, states>& of(std::uint8_t colour) const { return of_kind_[kind_[colour]]; }

 private:
  std::array<std::uint8_t, Scene::outside + 1> kind_;
  std::array<std::array<float, states>, 6> of_kind_;
};

}  // namespace

LineSegmentation segment_line(std::span<const std::uint8_t> classes, const std::array<std::uint8_t, 3>& bands) {
  const std::size_t count = classes.size();
  std::vector<std::array<bool, states>> entered(count);  // the best path enters this state at this sample
  std::array<float, states> best{0, 0, 0, 0, 0};
  const Rewards rewards(bands);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& reward = rewards.of(classes[i]);
    for (std::size_t state = states; state-- > 1;) {
      entered[i][state] = best[state - 1] > best[state];
      best[state] = std::max(best[state - 1], best[state]) + reward[state];
    }
    best[0] += reward[0];
  }

  LineSegmentation segmentation;
  std::size_t state = static_cast<std::size_t>(std::max_element(best.begin(), best.end()) - best.begin());
  for (std::size_t k = state; k < 4; ++k) segmentation.position[k] = static_cast<double>(count);
  for (std::size_t i = count; i-- > 0 && state > 0;) {
    if (!entered[i][state]) continue;
    --state;
    segmentation.position[state] = static_cast<double>(i);
    segmentation.seen[state] = supported(classes, i, state, bands);
  }
  for (std::size_t band = 1; band <= bands.size(); ++band)
    for (auto i = static_cast<std::size_t>(segmentation.position[band - 1]); i < segmentation.position[band]; ++i)
      segmentation.score += rewards.of(classes[i])[band];
  return segmentation;
}

}  // namespace lapservo::internal
