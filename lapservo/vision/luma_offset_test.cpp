#include "lapservo/vision/luma_offset.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/geometry/response.h"

namespace lapservo::internal {
namespace {

constexpr int clear_px = PooledEdge::reach;

const std::array<float, 256>& srgb_light() {
  static const auto table = Response{}.table();
  return table;
}

// A dark shaft to a light ink, a light ink to a dark one, which luma takes for an edge half a pixel aside.
const std::array<std::array<Eigen::Vector3d, 2>, 2> pairs{
    {{Eigen::Vector3d(0.16, 0.16, 0.16), Eigen::Vector3d(0.25, 0.85, 0.5)},
     {Eigen::Vector3d(0.8, 0.8, 0.15), Eigen::Vector3d(0.8, 0.14, 0.45)}}};

ProcessedEdge::Linearised model_of(const PictureProcessing& processing, const std::array<Eigen::Vector3d, 2>& pair) {
  return ProcessedEdge(srgb_light())
      .linearised(ProcessingFilters(processing, true), processing, edge_of(processing, pair[0], pair[1], 0));
}

EdgeSamples shown(const PictureProcessing& processing, const std::array<Eigen::Vector3d, 2>& pair, double offset_px) {
  return ProcessedEdge(srgb_light())
      .values(ProcessingFilters(processing, false), processing, edge_of(processing, pair[0], pair[1], offset_px));
}

EdgeSamples smoothed(const EdgeSamples& values, float side) {
  EdgeSamples out = values;
  for (Eigen::Index i = 1; i + 1 < values.size(); ++i)
    if (i % edge_rows != 0 && i % edge_rows != edge_rows - 1)
      out[i] += side * (values[i - 1] - 2 * values[i] + values[i + 1]);
  return out;
}

// However widely colour differences are spread, and whatever is expected of them.
TEST(LumaOffset, IsTheEdgesWhateverColourDifferencesShow) {
  const PictureProcessing expected{.blur_px = 0.9, .chroma_variance_px2 = 1};
  PictureProcessing wide = expected;
  wide.chroma_variance_px2 = 3;
  for (const auto& pair : pairs)
    for (const double offset_px : {-0.15, 0.0, 0.1})
      EXPECT_NEAR(offset_by_luma_px(model_of(expected, pair), shown(wide, pair, offset_px), clear_px), offset_px, 0.01);
}

// As an encoder leaves it: weak edges smoothed, values a level or two lower.
TEST(LumaOffset, IsNotMovedByLumasBlurAndLevel) {
  const PictureProcessing processing{.blur_px = 0.9, .chroma_variance_px2 = 2};
  for (const auto& pair : pairs) {
    const EdgeSamples blurred = smoothed(shown(processing, pair, 0.1), 0.1F);
    const EdgeSamples lower = (blurred.array() - 0.007F).matrix();
    EXPECT_NEAR(offset_by_luma_px(model_of(processing, pair), lower, clear_px), 0.1, 0.02);
  }
}

TEST(LumaOffset, IsNoneWhereLumaIsEven) {
  const PictureProcessing processing{.blur_px = 0.9};
  const std::array<Eigen::Vector3d, 2> even{Eigen::Vector3d(0.4, 0.5, 0.6), Eigen::Vector3d(0.4, 0.5, 0.6)};
  EXPECT_NEAR(offset_by_luma_px(model_of(processing, even), shown(processing, even, 0), clear_px), 0, 1e-3);
}

}  // namespace
}  // namespace lapservo::internal
