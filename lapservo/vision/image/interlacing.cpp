#include "lapservo/vision/image/interlacing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <Eigen/Geometry>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/image/lens_field.h"

namespace lapservo::internal {
namespace {

constexpr int taps = 4, chunk_px = 16, needed_px = chunk_px + taps - 1, channels = 3;
// Levels of 255. Fields show at the low one without noise; through strong noise, at the high one.
constexpr std::uint8_t sampled_gap = 20, low_gap = 6, high_gap = 24;

// At how many pixels of a box four neighbours alternate: the two of one parity both brighter than the two of the other.
// Where two fields saw something in two places, columns do; by noise, texture and compression columns and rows alike.
struct Alternation {
  int down = 0;    // (u, v) to (u, v + 3)
  int across = 0;  // (u, v) to (u + 3, v)
};

// By how much both values of one parity exceed both of the other; 0 when they do not. In bytes throughout: the compiler
// then takes sixteen at a time.
std::uint8_t gap(std::uint8_t a, std::uint8_t b, std::uint8_t c, std::uint8_t d) {
  const std::uint8_t low_even = std::min(a, c), high_even = std::max(a, c);
  const std::uint8_t low_odd = std::min(b, d), high_odd = std::max(b, d);
  const auto even_above = static_cast<std::uint8_t>(std::max(low_even, high_odd) - high_odd);
  const auto odd_above = static_cast<std::uint8_t>(std::max(low_odd, high_even) - high_even);
  return std::max(even_above, odd_above);
}

// How many of `Bytes` neighbours alternate.
template <int Bytes>
int count_alternating(const std::uint8_t* a, const std::uint8_t* b, const std::uint8_t* c, const std::uint8_t* d,
                      std::uint8_t least) {
  static_assert(Bytes <= 255);
  std::uint8_t count = 0;
  for (int i = 0; i < Bytes; ++i) count = static_cast<std::uint8_t>(count + (gap(a[i], b[i], c[i], d[i]) > least));
  return count;
}

// By chunks spread over all rows and columns of the box. Cheap, and with false alarms: beyond what counts scatter.
bool is_suspicious(const ImageView& image, const cv::Rect& box) {
  constexpr int max_pixels = 2500, stagger = 5, bytes = channels * chunk_px;
  constexpr double sigmas = 2, few = 2;
  int every = 1;  // a power of two: a multiple of the odd stagger then meets all chunks
  while (box.area() / every > max_pixels) every *= 2;
  Alternation sum;
  for (int v = box.y; v + taps <= box.br().y; ++v)
    for (int u = box.x + v * stagger % every * chunk_px; u + needed_px <= box.br().x; u += every * chunk_px) {
      const std::uint8_t* at = image.pixel(u, v);
      const std::ptrdiff_t row = image.row_bytes;
      sum.down += count_alternating<bytes>(at, at + row, at + 2 * row, at + 3 * row, sampled_gap);
      sum.across += count_alternating<bytes>(at, at + channels, at + 2 * channels, at + 3 * channels, sampled_gap);
    }
  return sum.down - sum.across > sigmas * std::sqrt(sum.down + sum.across) + few;
}

// In luma, which chroma subsampling spares, where the parities differ by more than `min_gap` levels.
Alternation luma_alternation(const ImageView& image, const cv::Rect& box, std::uint8_t min_gap) {
  Alternation sum;
  for (int u = box.x; u + needed_px <= box.br().x; u += chunk_px) {
    std::array<std::array<std::uint8_t, needed_px>, taps> rows{};  // a ring, in which each row keeps its parity
    for (int v = box.y; v < box.br().y; ++v) {
      auto& row = rows[static_cast<std::size_t>(v % taps)];
      const std::uint8_t* bgr = image.pixel(u, v);
      for (std::size_t i = 0; i < row.size(); ++i, bgr += channels)
        row[i] = static_cast<std::uint8_t>((bgr[0] + 5 * bgr[1] + 2 * bgr[2]) >> 3);
      if (v < box.y + taps - 1) continue;
      sum.down += count_alternating<chunk_px>(rows[0].data(), rows[1].data(), rows[2].data(), rows[3].data(), min_gap);
      sum.across += count_alternating<chunk_px>(row.data(), row.data() + 1, row.data() + 2, row.data() + 3, min_gap);
    }
  }
  return sum;
}

// A box about points of the raw image, cut at its borders. Empty when a point is nowhere.
cv::Rect box_about(const Camera& camera, std::span<const Eigen::Vector2d> raw_px, double margin_px) {
  Eigen::AlignedBox2d box_px;
  for (const Eigen::Vector2d& point_px : raw_px) {
    if (!point_px.allFinite()) return {};
    box_px.extend(point_px);
  }
  const Eigen::Vector2d low = box_px.min().array() - margin_px, high = box_px.max().array() + margin_px + 1;
  const auto cut = [](double px, int end) { return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(end))); };
  return {cv::Point(cut(low.x(), camera.width_px), cut(low.y(), camera.height_px)),
          cv::Point(cut(high.x(), camera.width_px), cut(high.y(), camera.height_px))};
}

cv::Rect box_of(const Camera& camera, const Marker& marker, const Observation& observation) {
  using What = Observation::Refused::What;
  constexpr double margin_px = 4;
  const auto& refused = observation.refused;
  const bool is_ok = observation.status == Status::ok;
  if (!is_ok && refused.what == What::edges) {
    const auto& edges_px = refused.edges_raw_px;
    return box_about(camera, edges_px,
                     margin_px + (edges_px[3] - edges_px[0]).norm() / 4);  // it is less wide than long
  }
  if (!is_ok && refused.what != What::pose) return {};
  const Rigid3& camera_from_unrolled = is_ok ? observation.camera_from_unrolled : refused.camera_from_unrolled;
  InplaceVector<Eigen::Vector2d, 8> corners;
  for (const double along_m : {0.0, marker.length_m()})
    for (const double x : {-1.0, 1.0})
      for (const double y : {-1.0, 1.0}) {
        const Eigen::Vector3d corner =
            camera_from_unrolled * Eigen::Vector3d(x * marker.radius_m(), y * marker.radius_m(), along_m);
        if (!(corner.z() > LensField::nearest_m)) return {};
        corners.push_back(camera.raw_from_point(corner));
      }
  return box_about(camera, corners, margin_px);
}

}  // namespace

// Limits that frames without fields stay below: chroma subsampling (4:2:2) of strong noise 0.6 and 0.1, of a sharp
// image 0.2 and 0.25. Fields 3 px apart across the shaft exceed it, 5 px along it, 10 px about it.
bool is_combed(const ImageView& image, const cv::Rect& box) {
  constexpr double min_per_px = 0.25, min_ratio = 0.3;
  if (!is_suspicious(image, box)) return false;
  const int perimeter_px = 2 * (box.width + box.height);
  for (const std::uint8_t min_gap : {low_gap, high_gap}) {
    const Alternation luma = luma_alternation(image, box, min_gap);
    if (luma.down - luma.across > std::max(min_per_px * perimeter_px, min_ratio * luma.across)) return true;
  }
  return false;
}

bool is_combed(const ImageView& image, const Camera& camera, const Marker& marker, const Observation& observation) {
  return is_combed(image, box_of(camera, marker, observation));
}

EvenField::EvenField(const Response& response) : light_of_value_(response.table()) {
  for (std::size_t level = 0, value = 0; level < value_of_light_.size(); ++level) {
    const float light = static_cast<float>(level) / static_cast<float>(value_of_light_.size() - 1);
    while (value < 255 && (light_of_value_[value] + light_of_value_[value + 1]) / 2 <= light) ++value;
    value_of_light_[level] = static_cast<std::uint8_t>(value);
  }
}

const cv::Mat& EvenField::of(const cv::Mat& frame_bgr) {
  field_bgr_.create(frame_bgr.size(), frame_bgr.type());
  const std::size_t row_bytes = static_cast<std::size_t>(channels) * static_cast<std::size_t>(frame_bgr.cols);
  const auto mean = [&](std::uint8_t a, std::uint8_t b) {
    const float light = (light_of_value_[a] + light_of_value_[b]) / 2;
    const float level = std::clamp(light, 0.0F, 1.0F) * static_cast<float>(value_of_light_.size() - 1);
    return value_of_light_[static_cast<std::size_t>(level + 0.5F)];
  };
  for (int v = 0; v < frame_bgr.rows; ++v) {
    const std::uint8_t* above = frame_bgr.ptr(v - v % 2);
    if (v % 2 == 0 || v + 1 == frame_bgr.rows)
      std::copy_n(above, row_bytes, field_bgr_.ptr(v));
    else
      std::transform(above, above + row_bytes, frame_bgr.ptr(v + 1), field_bgr_.ptr(v), mean);
  }
  return field_bgr_;
}

}  // namespace lapservo::internal
