#include "lapservo/sim/optics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace lapservo::internal {

Optics::Optics(double blur_px) {
  const int reach = std::max(0, static_cast<int>(std::ceil(4 * blur_px - 0.5)));
  double sum = 0;
  for (int i = 0; i <= reach; ++i) {
    const double weight = i == 0 ? 1 : std::exp(-0.5 * i * i / (blur_px * blur_px));
    weights_.push_back(static_cast<float>(weight));
    sum += i == 0 ? weight : 2 * weight;
  }
  for (float& weight : weights_) weight = static_cast<float>(weight / sum);
}

const float* Optics::row(const cv::Mat& light, int v, int begin, int end) {
  const int reach = reach_px();
  const auto source = [&](int y) { return light.ptr<float>(std::clamp(y, 0, light.rows - 1)); };
  const int from = std::max(0, begin - reach), to = std::min(light.cols, end + reach);
  const auto count = static_cast<std::size_t>(3 * (end - begin)), wide = count + static_cast<std::size_t>(6 * reach);
  column_.resize(wide);
  row_.resize(count);
  float* __restrict column = column_.data() + 3 * (from - (begin - reach));
  const float* middle = source(v) + 3 * from;
  const int inner = 3 * (to - from);
  for (int i = 0; i < inner; ++i) column[i] = weights_[0] * middle[i];
  for (int k = 1; k <= reach; ++k) {
    const float weight = weights_[static_cast<std::size_t>(k)];
    const float* above = source(v - k) + 3 * from;
    const float* below = source(v + k) + 3 * from;
    for (int i = 0; i < inner; ++i) column[i] += weight * (above[i] + below[i]);
  }
  for (float* at = column - 3; at >= column_.data(); at -= 3) std::copy_n(at + 3, 3, at);
  for (float* at = column + inner; at < column_.data() + wide; at += 3) std::copy_n(at - 3, 3, at);

  const float* centre = column_.data() + 3 * reach;
  float* __restrict out = row_.data();
  for (std::size_t i = 0; i < count; ++i) out[i] = weights_[0] * centre[i];
  for (int k = 1; k <= reach; ++k) {
    const float weight = weights_[static_cast<std::size_t>(k)];
    const float* left = centre - 3 * k;
    const float* right = centre + 3 * k;
    for (std::size_t i = 0; i < count; ++i) out[i] += weight * (left[i] + right[i]);
  }
  return out;
}

}  // namespace lapservo::internal
