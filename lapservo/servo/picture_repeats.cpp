#include "lapservo/servo/picture_repeats.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace lapservo::internal {
namespace {

// An image in so many parts each way. A shaft in motion does not change three quarters of them, nor does the black
// around a round image take a quarter.
constexpr int parts = 4, most_parts = 12;
constexpr int noisy_after = 10, noiseless_after = 3;

bool same(const cv::Mat& a, const cv::Mat& b) {
  const std::size_t row_bytes = static_cast<std::size_t>(a.cols) * a.elemSize();
  for (int v = 0; v < a.rows; ++v)
    if (std::memcmp(a.ptr(v), b.ptr(v), row_bytes) != 0) return false;
  return true;
}

// At 12 x 12 of its pixels.
bool part_differs(const cv::Mat& a, const cv::Mat& b, int row, int column) {
  constexpr int samples = 12, each_way = parts * samples;
  for (int i = 0; i < samples; ++i)
    for (int j = 0; j < samples; ++j) {
      const int v = (row * samples + i) * a.rows / each_way, u = (column * samples + j) * a.cols / each_way;
      const std::size_t at = static_cast<std::size_t>(u) * a.elemSize();
      if (std::memcmp(a.ptr(v) + at, b.ptr(v) + at, a.elemSize()) != 0) return true;
    }
  return false;
}

bool differs_in_most_places(const cv::Mat& a, const cv::Mat& b) {
  int differing = 0;
  for (int row = 0; row < parts; ++row)
    for (int column = 0; column < parts; ++column) differing += part_differs(a, b, row, column) ? 1 : 0;
  return differing >= most_parts;
}

}  // namespace

Repetition PictureRepeats::add(const cv::Mat& bgr) {
  const cv::Mat before = before_;
  before_ = bgr;
  if (before.size() != bgr.size() || before.type() != bgr.type() || before.data == bgr.data) return Repetition::none;
  if (same(before, bgr))
    return noiseless_ < noiseless_after && noisy_ >= noisy_after ? Repetition::of_a_noisy_camera
                                                                 : Repetition::possible_at_rest;
  if (!differs_in_most_places(before, bgr)) {
    noiseless_ = std::min(noiseless_ + 1, noiseless_after);
  } else if (noisy_ < noisy_after) {
    ++noisy_;
  }
  return Repetition::none;
}

}  // namespace lapservo::internal
