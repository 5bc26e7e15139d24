#include "lapservo/vision/camera/picture_processing.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "lapservo/geometry/response.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/shots.h"
#include "lapservo/vision/camera/test_edges.h"

namespace lapservo::internal::picture_processing_test {

using scenes::Shot;
using scenes::usual_shot;

const LightTable& srgb() {
  static const auto table = Response{}.table();
  return table;
}

// Dark shaft, three inks, dark shaft.
constexpr std::array<std::array<double, 3>, 5> inks{
    {{0.15, 0.15, 0.16}, {0.25, 0.75, 0.5}, {0.8, 0.75, 0.25}, {0.8, 0.3, 0.5}, {0.15, 0.15, 0.16}}};

PooledEdge pooled(std::size_t boundary, const EdgeSamples& values, double located_px) {
  PooledEdge edge;
  edge.boundary = boundary, edge.places = 64, edge.residual_px = located_px;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < PooledEdge::samples; ++i)
      edge.value[c][i] = values[static_cast<Eigen::Index>(edge_rows * c + i)];
  return edge;
}

// For boundaries at `offset_px` that were located at `located_px`, between inks that are darker by `shade`.
PooledEdges edges_of(const PictureProcessing& processing, double offset_px, double located_px = 0, double shade = 1) {
  const ProcessingFilters filters(processing, false);
  PooledEdges edges;
  for (std::size_t k = 0; k < 4; ++k) {
    const EdgeVector edge = edge_of(processing, shade * Eigen::Vector3d(inks[k].data()),
                                    shade * Eigen::Vector3d(inks[k + 1].data()), offset_px);
    edges.all.push_back(pooled(k, processed_edge(srgb(), filters, edge), located_px));
  }
  return edges;
}

TEST(PictureProcessing, AStepOfLightIsLocatedWhereItIs) {
  const auto explained = explain(srgb(), edges_of({.blur_px = 1}, 0.2, 0.2), 1);
  ASSERT_TRUE(explained);
  EXPECT_FALSE(is_believed(*explained));
  for (const auto& bias_px : explained->bias_px) EXPECT_NEAR(bias_px.value(), 0, 0.01);
}

TEST(PictureProcessing, IsToldFromTheBoundaries) {
  for (const PictureProcessing& truth :
       {PictureProcessing{.blur_px = 1, .sharpening = 0.7, .sharpening_px = 1.3},
        PictureProcessing{.blur_px = 0.9, .chroma_variance_px2 = 1},
        PictureProcessing{.blur_px = 1.1, .saturation = 1.25},
        PictureProcessing{.blur_px = 1, .chroma_variance_px2 = 1.5, .chroma_shift_px = -0.45},
        PictureProcessing{.blur_px = 1, .chroma_variance_px2 = 1.5, .saturation = 1.1, .sharpening = 0.4}}) {
    const PooledEdges edges = edges_of(truth, 0.1);
    const auto guess = first_guess(srgb(), edges, 1);
    ASSERT_TRUE(guess);
    EXPECT_TRUE(is_processed(*guess));
    const auto explained = explain(srgb(), edges, 1);
    ASSERT_TRUE(explained);
    EXPECT_TRUE(is_believed(*explained));
    EXPECT_LT(explained->misfit, 0.002);
    EXPECT_NEAR(explained->processing.blur_px, truth.blur_px, 0.05);
    EXPECT_NEAR(explained->processing.chroma_variance_px2, truth.chroma_variance_px2, 0.15);
    EXPECT_NEAR(explained->processing.saturation, truth.saturation, 0.05);
    EXPECT_NEAR(explained->processing.sharpening, truth.sharpening, 0.25);
    EXPECT_NEAR(explained->processing.chroma_shift_px, truth.chroma_shift_px, 0.05);
  }
}

// Wherever locate_edges located it and wherever the pose has it; also where most of a channel is clipped, which shows
// saturation less well.
TEST(PictureProcessing, ABoundaryIsFoundWhereItIs) {
  const auto explained = [](const PictureProcessing& processing, double offset_px, double located_px) {
    const auto found = explain(srgb(), edges_of(processing, offset_px, located_px), 1).value();
    for (const auto& bias_px : found.bias_px)
      EXPECT_NEAR(located_px - bias_px.value(), offset_px, 0.02) << processing.saturation;
    return found;
  };
  const PictureProcessing sharpened{.blur_px = 1, .sharpening = 0.7};
  for (const PictureProcessing& processing :
       {sharpened, PictureProcessing{.blur_px = 0.9, .chroma_variance_px2 = 1},
        PictureProcessing{.blur_px = 0.95, .log_mosaic = 0.15, .saturation = 1.2, .sharpening = 0.4},
        PictureProcessing{.blur_px = 1, .saturation = 1.6}, PictureProcessing{.blur_px = 1, .saturation = 1.8}})
    for (const double offset_px : {-0.1, 0.15}) explained(processing, offset_px, 0.3);
  for (const double offset_px : {-2.0, -1.0, 2.0})
    EXPECT_TRUE(is_believed(explained(sharpened, offset_px, offset_px + 0.1)));
}

// Each brightness has its own, as far as the processing moved that.
TEST(PictureProcessing, MeasurementsAreCorrectedByThoseThatAreAsBright) {
  const PictureProcessing processing{.blur_px = 1, .saturation = 1.5};
  PooledEdges edges = edges_of(processing, 0, 0.1, 0.6);
  for (const PooledEdge& bright : edges_of(processing, 0, -0.2).all) edges.all.push_back(bright);
  edges.of_measurement[7] = 1, edges.of_measurement[9] = 5;
  const auto explained = explain(srgb(), edges, 1);
  ASSERT_TRUE(explained);
  EXPECT_NEAR(explained->measurement_bias_px[7], 0.1, 0.02);
  EXPECT_NEAR(explained->measurement_bias_px[9], -0.2, 0.02);
  EXPECT_NEAR(explained->bias_px[1].value(), -0.05, 0.02);
  EXPECT_EQ(explained->measurement_bias_px[8], 0);
}

// A blur of luma after the response, where it may be one and where it may not.
TEST(PictureProcessing, SharpensNoLessThanItMay) {
  const PooledEdges edges = edges_of({.blur_px = 0.9, .chroma_variance_px2 = 2, .sharpening = -0.3}, 0);
  const auto any = explain(srgb(), edges, 1), none = explain(srgb(), edges, 1, {.least_sharpening = 0});
  ASSERT_TRUE(any && none);
  EXPECT_LT(any->processing.sharpening, -0.1);
  EXPECT_GE(none->processing.sharpening, 0);
}

TEST(PictureProcessing, TooLittleTellsNothing) {
  PooledEdges edges = edges_of({.blur_px = 1, .sharpening = 0.7}, 0);
  edges.all[0].places = edges.all[1].places = 2;
  EXPECT_FALSE(first_guess(srgb(), edges, 1));
  EXPECT_FALSE(explain(srgb(), edges, 1));
}

TEST(PictureProcessing, ABoundaryThatWasNotSeenIsInDoubtByAsMuchAsTheWorst) {
  PooledEdges edges = edges_of({.blur_px = 1, .sharpening = 0.7}, 0, 0.05);
  edges.all[2].places = 2;
  const auto explained = explain(srgb(), edges, 1);
  ASSERT_TRUE(explained);
  EXPECT_FALSE(explained->bias_px[2]);
  const auto moved_px = magnitudes_px(explained->bias_px);
  EXPECT_GT(moved_px[2], 0.02);
  for (const std::size_t k : {0U, 1U, 3U}) EXPECT_LE(moved_px[k], moved_px[2]);
}

Measurement measured_at(const Eigen::Vector2f& place_px, const Eigen::Vector2f& normal, double residual_px = 0) {
  Measurement m{};
  m.group = 1, m.expected_px = place_px, m.normal = normal, m.clear_px = 6, m.residual_px = residual_px;
  return m;
}

// Whatever the number of places located: as many as wanted, or all.
TEST(PooledEdges, TakesAsManyPlacesAsAskedFor) {
  constexpr int most = 12;
  for (const int located : {5, 12, 13, 14, 25, 60}) {
    const std::vector<Measurement> measurements(static_cast<std::size_t>(located), measured_at({100, 100}, {1, 0}));
    EXPECT_EQ(pool_edges(usual_shot(1).sight.light(), measurements, Look::glance).all[0].places,
              std::min(located, most))
        << located;
  }
}

// An image that is bright on the right: a place is averaged with those that are as bright.
TEST(PooledEdges, AverageWhatIsAsBright) {
  cv::Mat bgr(60, 200, CV_8UC3, cv::Scalar(40, 60, 20));
  bgr(cv::Rect(100, 0, 100, 60)) = cv::Scalar(140, 160, 120);
  const ImageView view(bgr);
  const LightImage light(view, srgb());
  std::vector<Measurement> measurements;
  for (const float u : {150.F, 20.F})
    measurements.insert(measurements.end(), 10, measured_at({u, 30}, {0.6F, 0.8F}, u / 200));
  const PooledEdges edges = pool_edges(light, measurements, Look::closely);
  ASSERT_EQ(edges.all.size(), 2U);
  EXPECT_NEAR(edges.all[0].value[1][3], 60 / 255.0, 1e-6);
  EXPECT_NEAR(edges.all[1].value[1][3], 160 / 255.0, 1e-6);
  EXPECT_NEAR(edges.all[0].residual_px, 0.1, 1e-6);
  EXPECT_EQ(edges.of_measurement[0], 1);
  EXPECT_EQ(edges.of_measurement[19], 0);
  EXPECT_EQ(edges.of_measurement[20], PooledEdges::nowhere);
}

// Edges that were located far from most places are something else, and move none of them.
TEST(PooledEdges, LeaveOutWhatLiesElsewhere) {
  std::vector<Measurement> measurements(20, measured_at({100, 100}, {1, 0}, 0.2));
  for (std::size_t i = 0; i < 5; ++i) measurements[4 * i].residual_px = 3;
  const PooledEdges edges = pool_edges(usual_shot(1).sight.light(), measurements, Look::closely);
  int places = 0;
  for (const PooledEdge& edge : edges.all) {
    EXPECT_NEAR(edge.residual_px, 0.2, 1e-9);
    places += edge.places;
  }
  EXPECT_EQ(places, 15);
  EXPECT_EQ(edges.of_measurement[4], PooledEdges::nowhere);
}

// A blurred step of light, encoded, so far on its bright side.
double encoded_step(double distance_px) {
  constexpr double blur_px = 0.8;
  const Response srgb;
  const double dark = srgb.light_from_value(25 / 255.0), bright = srgb.light_from_value(170 / 255.0);
  return srgb.value_from_light(dark + (bright - dark) * std::erfc(-distance_px / (blur_px * std::sqrt(2.0))) / 2);
}

cv::Mat picture_of_step(const Eigen::Vector2d& middle_px, const Eigen::Vector2d& normal) {
  cv::Mat bgr(60, 60, CV_8UC3);
  for (int v = 0; v < bgr.rows; ++v)
    for (int u = 0; u < bgr.cols; ++u) {
      const double value = encoded_step((Eigen::Vector2d(u, v) - middle_px).dot(normal));
      bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(static_cast<std::uint8_t>(std::lround(255 * value)));
    }
  return bgr;
}

// Values of pixels, sampled between them wherever the step lies among them: in the mean what the camera encodes there.
TEST(PooledEdges, CubicSamplesHaveTheMeanOfWhatIsEncoded) {
  constexpr int phases = 8;
  for (const double angle_rad : {0.0, 0.4, 0.785}) {
    const Eigen::Vector2d normal(std::cos(angle_rad), std::sin(angle_rad)), along(-normal.y(), normal.x());
    std::array<double, PooledEdge::samples> mean{};
    for (int phase = 0; phase < phases; ++phase) {
      const Eigen::Vector2d middle_px(30 + static_cast<double>(phase) / phases, 30);
      const cv::Mat bgr = picture_of_step(middle_px, normal);
      const ImageView view(bgr);
      std::vector<Measurement> measurements(40);
      for (std::size_t i = 0; i < measurements.size(); ++i) {
        measurements[i].normal = normal.cast<float>(), measurements[i].clear_px = 6;
        measurements[i].expected_px = (middle_px + (0.47 * static_cast<double>(i) - 9) * along).cast<float>();
      }
      const PooledEdges edges = pool_edges(LightImage(view, srgb()), measurements, Look::closely);
      for (const PooledEdge& edge : edges.all)
        for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += edge.value[0][i] * edge.places / (40 * phases);
    }
    for (int i = 0; i < PooledEdge::samples; ++i)
      EXPECT_NEAR(mean[static_cast<std::size_t>(i)], encoded_step(i - PooledEdge::reach), 1.5e-3)
          << angle_rad << ", " << i;
  }
}

constexpr std::uint64_t shots = 6;

FineFit fit_to(const Shot& shot, const cv::Mat& bgr) {
  const scenes::Sight sight(shot.rig, bgr);
  return fit_finely(sight.scene(), sight.light(), shot.truth(true), {});
}

cv::Mat seen_through(const effects::CameraEffects& effects, const Shot& shot) {
  return effects::seen_through(effects, shot.bgr, shot.rig.camera);
}

// As decoders that repeat chroma, or take it for sited elsewhere, place it.
cv::Mat with_chroma_moved(const cv::Mat& bgr, double right_px, double down_px) {
  cv::Mat picture, out;
  bgr.convertTo(picture, CV_32FC3, 1.0 / 255);
  cv::cvtColor(picture, picture, cv::COLOR_BGR2YCrCb);
  std::array<cv::Mat, 3> planes;
  cv::split(picture, planes.data());
  const cv::Matx23d moved(1, 0, right_px, 0, 1, down_px);
  for (const std::size_t c : {1U, 2U})
    cv::warpAffine(planes[c].clone(), planes[c], moved, bgr.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::merge(planes.data(), planes.size(), picture);
  cv::cvtColor(picture, picture, cv::COLOR_YCrCb2BGR);
  picture.convertTo(out, CV_8UC3, 255);
  return out;
}

// Without the shift as an unknown the mean is up to 25 mrad off.
TEST(PictureProcessing, ChromaBesideItsPlaceDoesNotMoveTheRotation) {
  for (const double right_px : {-0.5, 0.0, 0.5})
    for (const double down_px : {-0.5, 0.0, 0.5}) {
      SCOPED_TRACE(::testing::Message() << right_px << ", " << down_px);
      double sum_rad = 0, squared_sigmas = 0;
      scenes::for_each_shot(shots, [&](const Shot& shot) {
        const cv::Mat seen = with_chroma_moved(seen_through({.subsampled = true}, shot), right_px, down_px);
        const FineFit fit = fit_to(shot, seen);
        EXPECT_EQ(fit.processing, Processing::found);
        const double error_rad = shot.psi_error_rad(fit.unknowns);
        sum_rad += error_rad, squared_sigmas += error_rad * error_rad / fit.psi_variance_rad2();
      });
      EXPECT_LT(std::abs(sum_rad / static_cast<double>(shots)), 1.5e-3);
      EXPECT_LT(std::sqrt(squared_sigmas / static_cast<double>(shots)), 1.5);
    }
}

TEST(PictureProcessing, IsNotSeenWhereThereIsNone) {
  scenes::for_each_shot(
      shots, [](const Shot& shot) { EXPECT_EQ(fit_to(shot, seen_through({}, shot)).processing, Processing::none); });
}

}  // namespace lapservo::internal::picture_processing_test
