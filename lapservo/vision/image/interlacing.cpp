#include "lapservo/vision/image/interlacing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/image/lens_field.h"

namespace lapservo::internal {
namespace {

constexpr int taps = 4, chunk_px = 16, channels = 3;
// Levels of 255. Fields show at the low one without noise; through strong noise, at the high one.
constexpr std::uint8_t sampled_gap = 20, low_gap = 6, high_gap = 24;

// At how many pixels of a box four neighbours alternate: the two of one parity both brighter than the two of the other.
// Where two fields saw something in two places, columns alternate; noise, texture and compression make columns and rows
// alternate alike.
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

// By a fraction of the box's bytes: chunks spread over all its rows and columns. Cheap, and with false alarms: beyond
// what counts scatter.
bool is_suspicious(const ImageView& image, const PixelBox& box) {
  constexpr int max_pixels = 2500, stagger = 5, bytes = channels * chunk_px;
  constexpr double sigmas = 2, few = 2;
  const int width_px = box.u_end - box.u_begin, height_px = box.v_end - box.v_begin;
  int every = 1;  // a power of two: a multiple of the odd stagger then meets all chunks
  while (static_cast<std::int64_t>(width_px) * height_px / every > max_pixels) every *= 2;
  Alternation sum;
  for (int v = box.v_begin; v + taps <= box.v_end; ++v)
    for (int u = box.u_begin + v * stagger % every * chunk_px; u + chunk_px + taps - 1 <= box.u_end;
         u += every * chunk_px) {
      const std::uint8_t* at = image.pixel(u, v);
      const std::ptrdiff_t row = image.row_bytes;
      sum.down += count_alternating<bytes>(at, at + row, at + 2 * row, at + 3 * row, sampled_gap);
      sum.across += count_alternating<bytes>(at, at + channels, at + 2 * channels, at + 3 * channels, sampled_gap);
    }
  return sum.down - sum.across > sigmas * std::sqrt(sum.down + sum.across) + few;
}

// In luma, which chroma subsampling spares, where the parities differ by more than `min_gap` levels.
Alternation luma_alternation(const ImageView& image, const PixelBox& box, std::uint8_t min_gap) {
  constexpr int needed_px = chunk_px + taps - 1;
  Alternation sum;
  for (int u = box.u_begin; u + needed_px <= box.u_end; u += chunk_px) {
    std::array<std::array<std::uint8_t, needed_px>, taps> rows{};  // a ring, in which each row keeps its parity
    for (int v = box.v_begin; v < box.v_end; ++v) {
      auto& row = rows[static_cast<std::size_t>(v % taps)];
      const std::uint8_t* bgr = image.pixel(u, v);
      for (std::size_t i = 0; i < row.size(); ++i, bgr += channels)
        row[i] = static_cast<std::uint8_t>((bgr[0] + 5 * bgr[1] + 2 * bgr[2]) >> 3);
      if (v < box.v_begin + taps - 1) continue;
      sum.down += count_alternating<chunk_px>(rows[0].data(), rows[1].data(), rows[2].data(), rows[3].data(), min_gap);
      sum.across += count_alternating<chunk_px>(row.data(), row.data() + 1, row.data() + 2, row.data() + 3, min_gap);
    }
  }
  return sum;
}

// A box about points of the raw image, cut at its borders. Nullopt when nothing of it is left, or a point is nowhere.
std::optional<PixelBox> box_about(const Camera& camera, std::span<const Eigen::Vector2d> raw_px, double margin_px) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL), high = -low;
  for (const Eigen::Vector2d& point_px : raw_px) {
    if (!point_px.allFinite()) return std::nullopt;
    low = low.cwiseMin(point_px), high = high.cwiseMax(point_px);
  }
  const auto cut = [](double px, int end) { return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(end))); };
  const PixelBox box{cut(low.x() - margin_px, camera.width_px), cut(low.y() - margin_px, camera.height_px),
                     cut(high.x() + margin_px + 1, camera.width_px), cut(high.y() + margin_px + 1, camera.height_px)};
  return box.u_begin < box.u_end && box.v_begin < box.v_end ? std::optional(box) : std::nullopt;
}

constexpr double margin_px = 4;

std::optional<PixelBox> box_of_pose(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled) {
  InplaceVector<Eigen::Vector2d, 8> corners;
  for (const double along_m : {0.0, marker.length_m()})
    for (const double x : {-1.0, 1.0})
      for (const double y : {-1.0, 1.0}) {
        const Eigen::Vector3d corner =
            camera_from_unrolled * Eigen::Vector3d(x * marker.radius_m(), y * marker.radius_m(), along_m);
        if (!(corner.z() > LensField::nearest_m)) return std::nullopt;
        corners.push_back(camera.raw_from_point(corner));
      }
  return box_about(camera, corners, margin_px);
}

std::optional<PixelBox> box_of(const Camera& camera, const Marker& marker, const Observation& observation) {
  using What = Observation::Refused::What;
  if (observation.status == Status::ok) return box_of_pose(camera, marker, observation.camera_from_unrolled);
  if (observation.refused.what == What::pose)
    return box_of_pose(camera, marker, observation.refused.camera_from_unrolled);
  if (observation.refused.what != What::edges) return std::nullopt;
  const auto& edges_px = observation.refused.edges_raw_px;
  return box_about(camera, edges_px, margin_px + (edges_px[3] - edges_px[0]).norm() / 4);  // it is less wide than long
}

}  // namespace

// Limits that frames without fields stay below: chroma subsampling (4:2:2) of strong noise 0.6 and 0.1, of a sharp
// image 0.2 and 0.25. Fields 3 px apart across the shaft exceed it, 5 px along it, 10 px about it.
bool is_combed(const ImageView& image, const PixelBox& box) {
  constexpr double min_per_px = 0.25, min_ratio = 0.3;
  if (!is_suspicious(image, box)) return false;
  const int perimeter_px = 2 * (box.u_end - box.u_begin + box.v_end - box.v_begin);
  for (const std::uint8_t min_gap : {low_gap, high_gap}) {
    const Alternation luma = luma_alternation(image, box, min_gap);
    if (luma.down - luma.across > std::max(min_per_px * perimeter_px, min_ratio * luma.across)) return true;
  }
  return false;
}

bool is_combed(const ImageView& image, const Camera& camera, const Marker& marker, const Observation& observation) {
  const auto box = box_of(camera, marker, observation);
  return box && is_combed(image, *box);
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
    std::uint8_t* row = field_bgr_.ptr(v);
    if (v % 2 == 0 || v + 1 == frame_bgr.rows) {
      std::copy_n(above, row_bytes, row);
      continue;
    }
    const std::uint8_t* below = frame_bgr.ptr(v + 1);
    for (std::size_t i = 0; i < row_bytes; ++i) row[i] = mean(above[i], below[i]);
  }
  return field_bgr_;
}

}  // namespace lapservo::internal
