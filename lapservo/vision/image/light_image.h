#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// A borrowed 8-bit BGR image.
struct ImageView {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t row_bytes = 0;
  int width_px = 0, height_px = 0;

  explicit ImageView(const cv::Mat& bgr)
      : data(bgr.data), row_bytes(static_cast<std::ptrdiff_t>(bgr.step[0])), width_px(bgr.cols), height_px(bgr.rows) {}

  const std::uint8_t* pixel(int u, int v) const { return data + v * row_bytes + 3 * static_cast<std::ptrdiff_t>(u); }
};

/// Where in a raw image each channel shows what green shows at a place.
struct ChannelGeometry {
  float centre_u = 0, centre_v = 0;
  std::array<float, 3> magnification{1, 1, 1};  ///< b, g, r, about the centre
  float reach_px = 0;                           ///< how far a channel's place lies from green's, at most
  float corner_px = 0;                          ///< from the centre

  ChannelGeometry() = default;
  explicit ChannelGeometry(const Camera& camera)
      : centre_u(static_cast<float>(camera.cx_px)), centre_v(static_cast<float>(camera.cy_px)) {
    corner_px = static_cast<float>(std::hypot(std::max(camera.cx_px, camera.width_px - camera.cx_px),
                                              std::max(camera.cy_px, camera.height_px - camera.cy_px)));
    if (camera.chromatic_aberration != ChromaticAberration{}) magnify(camera.chromatic_aberration);
  }
  /// By so much more.
  void magnify(const ChromaticAberration& more) {
    magnification[0] *= static_cast<float>(more.blue), magnification[2] *= static_cast<float>(more.red);
    reach_px = corner_px * std::max(std::abs(magnification[0] - 1), std::abs(magnification[2] - 1));
  }
  bool differs() const { return reach_px > 0; }
  Eigen::Vector2f centre() const { return {centre_u, centre_v}; }
  /// Calls `read<First, Last>(u, v)` for channels First to Last, where the image shows them of green's place.
  template <typename Read>
  void for_each_place(float u, float v, const Read& read) const {
    if (!differs()) return read.template operator()<0, 3>(u, v);
    const auto place = [&](std::size_t c, float centre, float x) { return centre + magnification[c] * (x - centre); };
    read.template operator()<0, 1>(place(0, centre_u, u), place(0, centre_v, v));
    read.template operator()<1, 2>(u, v);
    read.template operator()<2, 3>(place(2, centre_u, u), place(2, centre_v, v));
  }
};

/// A frame in linear light, decoded where it is looked at. Optical blur acts on light, so edges are located in it.
/// Places are green's; those of blue and red are found by the camera's chromatic aberration.
class LightImage {
 public:
  LightImage(const ImageView& image, const LightTable& light_of_value, const ChannelGeometry& channels = {})
      : image_(&image), light_(&light_of_value), channels_(channels) {}

  const ImageView& image() const { return *image_; }
  const ChannelGeometry& channels() const { return channels_; }
  const LightTable& light_of_value() const { return *light_; }

  /// Encoded values at and above this are taken for saturated: the light there is unknown.
  static constexpr std::uint8_t saturated_value = 252;

  struct Sample {
    std::array<float, 3> light;  ///< b, g, r in [0, 1]
    std::array<bool, 3> saturated;
  };

  /// Bilinear; contains() the point.
  Sample at(float u, float v) const {
    Sample sample;
    channels_.for_each_place(u, v, [&]<std::size_t First, std::size_t Last>(float at_u, float at_v) {
      const int iu = static_cast<int>(at_u), iv = static_cast<int>(at_v);
      const float fu = at_u - static_cast<float>(iu), fv = at_v - static_cast<float>(iv);
      const std::uint8_t* top = image_->pixel(iu, iv);
      const std::uint8_t* bottom = top + image_->row_bytes;
      const LightTable& light = *light_;
      const float w00 = (1 - fu) * (1 - fv), w01 = fu * (1 - fv), w10 = (1 - fu) * fv, w11 = fu * fv;
      for (std::size_t c = First; c < Last; ++c) {
        sample.light[c] =
            w00 * light[top[c]] + w01 * light[top[c + 3]] + w10 * light[bottom[c]] + w11 * light[bottom[c + 3]];
        sample.saturated[c] = (top[c] >= saturated_value) | (top[c + 3] >= saturated_value) |
                              (bottom[c] >= saturated_value) | (bottom[c + 3] >= saturated_value);
      }
    });
    return sample;
  }
  /// Whether at() can sample there. A place that rounds onto the last pixel in single precision counts as outside.
  bool contains(const Eigen::Vector2d& raw_px) const {
    constexpr double rounding_px = 0.01;
    const double border_px = channels_.reach_px;
    return raw_px.x() >= border_px && raw_px.y() >= border_px &&
           raw_px.x() < image_->width_px - 1 - border_px - rounding_px &&
           raw_px.y() < image_->height_px - 1 - border_px - rounding_px;
  }

 private:
  const ImageView* image_;
  const LightTable* light_;
  ChannelGeometry channels_;
};

}  // namespace lapservo::internal
