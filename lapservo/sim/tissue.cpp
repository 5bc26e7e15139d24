#include "lapservo/sim/tissue.h"

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

// Smooth noise in about [-1, 1]: octaves of a random grid, interpolated.
cv::Mat octaves(int width_px, int height_px, int cells, int count, Random& random) {
  cv::Mat sum(height_px, width_px, CV_32F, cv::Scalar(0));
  double amplitude = 1, total = 0;
  for (int octave = 0; octave < count; ++octave) {
    const int columns = cells << octave, rows = std::max(2, columns * height_px / width_px);
    cv::Mat grid(rows + 3, columns + 3, CV_32F), fine;
    for (int r = 0; r < grid.rows; ++r)
      for (int c = 0; c < grid.cols; ++c) grid.at<float>(r, c) = static_cast<float>(random.uniform(-1, 1));
    cv::resize(grid, fine, {width_px, height_px}, 0, 0, cv::INTER_CUBIC);
    sum += fine * amplitude;
    total += amplitude;
    amplitude *= 0.5;
  }
  return sum / total * 2;
}

// The colour of a pixel from its noises. Rows are coloured by such loops over plain arrays, which compilers vectorise.
struct NoiseRow {
  const float *organ, *fold, *grain, *vessel;
};

void colour_row(const NoiseRow& noise, int width_px, float* light) {
  constexpr float liver[3] = {0.035F, 0.022F, 0.13F}, fat[3] = {0.16F, 0.38F, 0.62F}, pink[3] = {0.22F, 0.2F, 0.5F},
                  blood[3] = {0.03F, 0.015F, 0.22F};
  for (int u = 0; u < width_px; ++u) {
    const float organ = noise.organ[u], thin = std::abs(noise.vessel[u]);
    const float to_pink = std::clamp(4 * (organ + 0.05F), 0.0F, 1.0F),
                to_fat = std::clamp(5 * (organ - 0.35F), 0.0F, 1.0F);
    const float to_blood = std::clamp(0.7F * (1 - thin / 0.035F), 0.0F, 1.0F);
    const float shade = std::max(0.05F, 0.75F + 0.45F * noise.fold[u] + 0.08F * noise.grain[u]);
    for (int c = 0; c < 3; ++c) {
      float colour = liver[c] + (pink[c] - liver[c]) * to_pink;
      colour += (fat[c] - colour) * to_fat;
      colour += (blood[c] - colour) * to_blood;
      light[3 * u + c] = colour * shade;
    }
  }
}

// Black around the endoscope's round field, darker towards its border.
void darken_outside_field(cv::Mat& light) {
  const double field_px = 0.5 * std::max(light.rows * 1.3, light.cols * 0.9);
  for (int v = 0; v < light.rows; ++v) {
    const double y = v - 0.5 * light.rows;
    auto* row = light.ptr<float>(v);
    for (int u = 0; u < light.cols; ++u) {
      const double x = u - 0.5 * light.cols, r = std::sqrt(x * x + y * y) / field_px;
      const double inside = std::clamp((1 - r) * field_px / 1.5 + 0.5, 0.0, 1.0);
      const auto left = static_cast<float>(inside * (1 - 0.55 * r * r));
      for (int c = 0; c < 3; ++c) row[3 * u + c] *= left;
    }
  }
}

void add_highlights(cv::Mat& light, Random& random) {
  cv::Mat glints(light.size(), CV_32F, cv::Scalar(0));
  for (int cluster = 0; cluster < 7; ++cluster) {
    const double u = random.uniform(0.15, 0.85) * light.cols, v = random.uniform(0.1, 0.9) * light.rows;
    const int count = static_cast<int>(random.uniform(5, 40));
    for (int i = 0; i < count; ++i) {
      // One number a statement: the order of arguments is the compiler's.
      const double y = v + random.normal() * light.rows / 30;
      const double x = u + random.normal() * light.cols / 40;
      const int width = static_cast<int>(random.uniform(1, 4));
      const int length = static_cast<int>(random.uniform(1, 7));
      const double brightness = random.uniform(0.4, 1.2);
      const double angle_deg = random.uniform(0, 180);
      cv::ellipse(glints, {static_cast<int>(x), static_cast<int>(y)}, {length, width}, angle_deg, 0, 360,
                  cv::Scalar(brightness), cv::FILLED);
    }
  }
  cv::GaussianBlur(glints, glints, {0, 0}, 0.8);
  cv::Mat channels;
  cv::merge(std::vector<cv::Mat>{glints, glints, glints}, channels);
  light += channels;
}

}  // namespace

cv::Mat make_tissue(int width_px, int height_px, std::uint64_t seed) {
  Random random(seed);
  const cv::Mat organ = octaves(width_px, height_px, 3, 3, random), fold = octaves(width_px, height_px, 5, 6, random);
  const cv::Mat grain = octaves(width_px, height_px, 60, 3, random),
                vessel = octaves(width_px, height_px, 8, 4, random);
  cv::Mat light(height_px, width_px, CV_32FC3);
  for (int v = 0; v < height_px; ++v)
    colour_row({organ.ptr<float>(v), fold.ptr<float>(v), grain.ptr<float>(v), vessel.ptr<float>(v)}, width_px,
               light.ptr<float>(v));
  add_highlights(light, random);
  darken_outside_field(light);
  return light;
}

}  // namespace lapservo::internal
