#include "lapservo/vision/picture_processing.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/geometry/response.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/limits.h"

namespace lapservo::internal {
namespace {

const std::array<float, 256>& srgb() {
  static const auto table = Response{}.table();
  return table;
}

// Dark shaft, three inks, dark shaft.
constexpr std::array<std::array<double, 3>, 5> inks{
    {{0.15, 0.15, 0.16}, {0.25, 0.75, 0.5}, {0.8, 0.75, 0.25}, {0.8, 0.3, 0.5}, {0.15, 0.15, 0.16}}};

PooledEdges edges_of(const PictureProcessing& processing, double offset_px) {
  PooledEdges edges;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    edges[k].value = processed_edge(srgb(), processing, {inks[k], inks[k + 1]}, offset_px);
    edges[k].places = 64;
  }
  return edges;
}

TEST(PictureProcessing, AStepOfLightIsLocatedWhereItIs) {
  const auto explained = explain(srgb(), edges_of({.blur_px = 1}, 0.2), 1);
  ASSERT_TRUE(explained);
  EXPECT_FALSE(is_believed(*explained));
  for (const auto& bias_px : explained->bias_px) EXPECT_NEAR(bias_px.value(), 0, 0.01);
}

TEST(PictureProcessing, IsToldFromTheBoundaries) {
  for (const PictureProcessing& truth :
       {PictureProcessing{.blur_px = 1, .sharpening = 0.7, .sharpening_px = 1.3},
        PictureProcessing{.blur_px = 0.9, .chroma_variance_px2 = 1},
        PictureProcessing{.blur_px = 1.1, .saturation = 1.25},
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
  }
}

// A blur of luma after the response, where it may be one and where it may not.
TEST(PictureProcessing, SharpensNoLessThanItMay) {
  const PooledEdges edges = edges_of({.blur_px = 0.9, .chroma_variance_px2 = 2, .sharpening = -0.3}, 0);
  const auto any = explain(srgb(), edges, 1), none = explain(srgb(), edges, 1, 0);
  ASSERT_TRUE(any && none);
  EXPECT_LT(any->processing.sharpening, -0.1);
  EXPECT_GE(none->processing.sharpening, 0);
}

TEST(PictureProcessing, TooLittleTellsNothing) {
  PooledEdges edges = edges_of({.blur_px = 1, .sharpening = 0.7}, 0);
  edges[0].places = edges[1].places = 2;
  EXPECT_FALSE(first_guess(srgb(), edges, 1));
  EXPECT_FALSE(explain(srgb(), edges, 1));
}

TEST(PictureProcessing, ABoundaryThatWasNotSeenIsInDoubtByAsMuchAsTheWorst) {
  PooledEdges edges = edges_of({.blur_px = 1, .sharpening = 0.7}, 0);
  edges[2].places = 2;
  const auto explained = explain(srgb(), edges, 1);
  ASSERT_TRUE(explained);
  EXPECT_FALSE(explained->bias_px[2]);
  const auto magnitudes_px = bias_magnitudes_px(*explained);
  EXPECT_GT(magnitudes_px[2], 0.02);
  for (const std::size_t k : {0U, 1U, 3U}) EXPECT_LE(magnitudes_px[k], magnitudes_px[2]);
}

TEST(PictureProcessing, IsDoubtedByTheShareThatItLeavesUnexplained) {
  const auto share = [](double misfit, double misfit_without) {
    ProcessedEdges edges;
    edges.misfit = misfit, edges.misfit_without = misfit_without;
    return unexplained_share(edges);
  };
  const double usual = fine_fit_limits.usual_misfit;
  EXPECT_EQ(share(usual, 5 * usual), 0);
  EXPECT_EQ(share(usual / 2, usual / 2), 0);
  EXPECT_GT(share(3 * usual, 5 * usual), share(2 * usual, 5 * usual));
  EXPECT_NEAR(share(50 * usual, 100 * usual), 0.5, 0.01);
  EXPECT_EQ(share(5 * usual, 5 * usual), 1);
  EXPECT_EQ(share(5 * usual, usual), 1);
}

// Whatever the number of places located: as many as asked for, or all.
TEST(PooledEdges, TakesAsManyPlacesAsAskedFor) {
  const scenes::Shot& shot = scenes::usual_shot(1);
  constexpr int most = 12;
  for (const int located : {5, 12, 13, 14, 25, 60}) {
    Measurement m{};
    m.group = 1, m.expected_px = {100, 100}, m.normal = {1, 0}, m.clear_px = 6;
    const std::vector<Measurement> measurements(static_cast<std::size_t>(located), m);
    EXPECT_EQ(pool_edges(shot.sight.light(), measurements, most)[1].places, std::min(located, most)) << located;
  }
}

constexpr std::uint64_t shots = 6;

FineFit fit_through(const effects::CameraEffects& effects, std::uint64_t seed, bool ask = true) {
  const scenes::Shot& shot = scenes::usual_shot(seed);
  const scenes::Sight sight(shot.rig, effects::seen_through(effects, shot.bgr, shot.rig.camera));
  return fit_finely(sight.scene(), sight.light(), shot.truth(true), {}, {.ask = ask});
}

double mean_error_rad(const effects::CameraEffects& effects, bool ask) {
  double sum_rad = 0;
  for (std::uint64_t seed = 1; seed <= shots; ++seed) {
    const FineFit fit = fit_through(effects, seed, ask);
    EXPECT_TRUE(fit.converged);
    EXPECT_EQ(fit.processing, ask ? Processing::found : Processing::unknown);
    sum_rad += fit.unknowns.q()->psi_rad - scenes::usual_shot(seed).q.psi_rad;
  }
  return sum_rad / static_cast<double>(shots);
}

TEST(PictureProcessing, SharpeningDoesNotMoveTheRotation) {
  effects::CameraEffects sharpened;
  sharpened.sharpening = 0.9, sharpened.sharpening_px = 1.3;
  EXPECT_GT(std::abs(mean_error_rad(sharpened, false)), 3e-3);
  EXPECT_LT(std::abs(mean_error_rad(sharpened, true)), 1.5e-3);
}

TEST(PictureProcessing, SubsampledChromaIsTold) {
  effects::CameraEffects subsampled;
  subsampled.subsampled = true;
  EXPECT_LT(std::abs(mean_error_rad(subsampled, true)), 3e-3);
}

TEST(PictureProcessing, IsNotSeenWhereThereIsNone) {
  for (std::uint64_t seed = 1; seed <= shots; ++seed) EXPECT_EQ(fit_through({}, seed).processing, Processing::none);
}

}  // namespace
}  // namespace lapservo::internal
