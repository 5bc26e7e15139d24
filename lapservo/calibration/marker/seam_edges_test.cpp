#include "lapservo/calibration/marker/seam_edges.h"

#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/testing/camera_effects.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::seam_edges_test {

// A print with a gap whose middle lies `beside_rad` around the shaft from where it faces the camera.
struct GapShot {
  Rig rig = scenes::usual_rig();
  JointVector q;
  cv::Mat bgr;

  explicit GapShot(std::uint64_t seed, double beside_rad = 0, double steepest_rad = 0.35) {
    Marker& marker = rig.instruments[0].marker;
    marker.gap_rad = 1e-3 / marker.radius_m();
    Random random(seed);
    q = scenes::random_configuration(rig, 0, random, steepest_rad);
    const auto view = view_cylinder(scenes::pose_of(rig, 0, q).camera_from_unrolled, marker.radius_m());
    q.psi_rad = view.value().facing_azimuth_rad - marker.seam_rad + marker.gap_rad / 2 + beside_rad;
    bgr = scenes::render(rig, {q}, seed);
  }
  // `by_luma`: as an image without colour differences shows it, which `picture` has blurred.
  std::optional<SeamEdges> seam(const cv::Mat& picture, const std::optional<PictureProcessing>& processing,
                                double blur_px = 0.9, bool by_luma = false) const {
    constexpr double reach_m = 0.4e-3;
    cv::Mat luma, grey;
    cv::cvtColor(picture, luma, cv::COLOR_BGR2GRAY);
    cv::cvtColor(luma, grey, cv::COLOR_GRAY2BGR);
    const scenes::Sight sight(rig, picture), grey_sight(rig, grey);
    const PoseUnknowns unknowns(scenes::pose_of(rig, 0, q), false);
    return measure_seam(sight.scene(), sight.light(), unknowns, blur_px, reach_m, true, processing,
                        by_luma ? &grey_sight.light() : nullptr);
  }
};

// Sharpening draws the edges of dark gaps towards one another.
TEST(SeamEdges, LieWhereTheyDoWithoutSharpening) {
  constexpr double amount = 0.8, radius_px = 1.4;
  const effects::CameraEffects effects{.sharpening = amount, .sharpening_px = radius_px};
  const PictureProcessing processing{.blur_px = 0.9, .sharpening = amount, .sharpening_px = radius_px};
  double moved_rad = 0, left_rad = 0;
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const GapShot shot(seed);
    const cv::Mat sharpened = effects::seen_through(effects, shot.bgr, shot.rig.camera);
    const auto plain = shot.seam(shot.bgr, std::nullopt);
    const auto moved = shot.seam(sharpened, std::nullopt), left = shot.seam(sharpened, processing);
    if (!plain || !moved || !left) continue;
    moved_rad += moved->gap_rad - plain->gap_rad, left_rad += left->gap_rad - plain->gap_rad;
    ++seen;
  }
  ASSERT_GE(seen, 5);
  EXPECT_LT(moved_rad / seen, -1e-3) << "or sharpening moves nothing";
  EXPECT_LT(std::abs(left_rad), 0.4 * std::abs(moved_rad));
}

// A gap of ten pixels is grey, so that blurred colour differences mix over all of it.
TEST(SeamEdges, LieWhereTheyDoByLumaWhereColoursAreBlurred) {
  const effects::CameraEffects effects{.subsampled = true};
  const PictureProcessing processing{.blur_px = 0.85, .chroma_variance_px2 = 1.2};
  constexpr double seen_px = 1.15;
  double by_colours = 0, by_luma = 0;
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const GapShot shot(seed);
    const cv::Mat blurred = effects::seen_through(effects, shot.bgr, shot.rig.camera);
    const auto plain = shot.seam(shot.bgr, std::nullopt), raw = shot.seam(blurred, std::nullopt, seen_px),
               luma = shot.seam(blurred, processing, seen_px, true);
    if (!plain || !raw || !luma) continue;
    by_colours += std::pow(raw->gap_rad - plain->gap_rad, 2), by_luma += std::pow(luma->gap_rad - plain->gap_rad, 2);
    ++seen;
  }
  ASSERT_GE(seen, 7);
  EXPECT_LT(by_luma, 0.25 * by_colours) << std::sqrt(by_luma / seen) << " of " << std::sqrt(by_colours / seen);
}

// A highlight is on the generatrix that faces the camera, and bands get darker from there.
TEST(SeamEdges, LieWhereTheyAreBesideHighlights) {
  for (const bool upper : {true, false}) {
    double sum_px = 0;
    int seen = 0;
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      constexpr double glaring_rad = 0.1;
      const double beside_rad = 0.1 + 0.02 * static_cast<double>(seed);
      const GapShot shot(seed, upper ? -beside_rad : beside_rad, glaring_rad);
      const auto seam = shot.seam(shot.bgr, std::nullopt);
      if (!seam) continue;
      const auto& edge = upper ? seam->upper : seam->lower;
      if (!edge) continue;
      sum_px += edge->row[edge->row.size() - 1] > 0 ? edge->residual_px : -edge->residual_px, ++seen;
    }
    ASSERT_GE(seen, 8);
    EXPECT_LT(std::abs(sum_px / seen), 0.03) << (upper ? "upper" : "lower");
  }
}

// The effect of compression on a seam is alike along the shaft.
TEST(SeamEdges, KnowHowFarCompressionMovesThem) {
  const effects::CameraEffects jpeg{.jpeg_quality = 50};
  double squares = 0, sigmas_px = 0;
  int seen = 0;
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    const GapShot shot(seed);
    const auto plain = shot.seam(shot.bgr, std::nullopt);
    const auto compressed = shot.seam(effects::seen_through(jpeg, shot.bgr, shot.rig.camera), std::nullopt);
    if (!plain || !compressed) continue;
    squares += std::pow((compressed->gap_rad - plain->gap_rad) / compressed->sigma_gap_rad, 2), ++seen;
    if (compressed->upper) sigmas_px = std::max(sigmas_px, compressed->upper->sigma_px);
  }
  ASSERT_GE(seen, 12);
  EXPECT_LT(std::sqrt(squares / seen), 1.5) << seen;
  EXPECT_LT(sigmas_px, 1) << "or nothing is known";
}

}  // namespace lapservo::internal::seam_edges_test
