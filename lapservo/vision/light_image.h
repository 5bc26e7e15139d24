#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/geometry/response.h"
#include "lapservo/vision/image_view.h"

namespace lapservo::internal {

/// A frame in linear light, decoded where it is looked at. Optical blur acts on light, so edges are located in it.
class LightImage {
 public:
  LightImage(const ImageView& image, const std::array<float, 256>& light_of_value)
      : image_(image), light_(light_of_value) {}

  const ImageView& image() const { return image_; }
  const std::array<float, 256>& light_of_value() const { return light_; }

  /// Encoded values at and above this are taken for saturated: the light there is unknown.
  static constexpr std::uint8_t saturated_value = 252;

  struct Sample {
    std::array<float, 3> light;  ///< b, g, r in [0, 1]
    std::array<bool, 3> saturated;
  };

  /// Bilinear; the point must lie inside the image by a pixel.
  Sample at(float u, float v) const {
    const int iu = static_cast<int>(u), iv = static_cast<int>(v);
    const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
    const std::uint8_t* top = image_.pixel(iu, iv);
    const std::uint8_t* bottom = top + image_.row_bytes;
    const float w00 = (1 - fu) * (1 - fv), w01 = fu * (1 - fv), w10 = (1 - fu) * fv, w11 = fu * fv;
    Sample sample;
    for (std::size_t c = 0; c < 3; ++c) {
      sample.light[c] =
          w00 * light_[top[c]] + w01 * light_[top[c + 3]] + w10 * light_[bottom[c]] + w11 * light_[bottom[c + 3]];
      sample.saturated[c] = (top[c] >= saturated_value) | (top[c + 3] >= saturated_value) |
                            (bottom[c] >= saturated_value) | (bottom[c + 3] >= saturated_value);
    }
    return sample;
  }
  /// Whether at() can sample there. A place that rounds onto the last pixel in single precision counts as outside.
  bool contains(const Eigen::Vector2d& raw_px) const {
    constexpr double rounding_px = 0.01;
    return raw_px.x() >= 0 && raw_px.y() >= 0 && raw_px.x() < image_.width_px - 1 - rounding_px &&
           raw_px.y() < image_.height_px - 1 - rounding_px;
  }

 private:
  const ImageView& image_;
  const std::array<float, 256>& light_;
};

}  // namespace lapservo::internal
