#include "lapservo/vision/edges/edge_blur.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::edge_blur_test {

// Edges whose blur along the line is `truth`'s, as located with `blur`: what a fit of their width says.
EllipseEvidence evidence_of(const EdgeBlur& truth, const EdgeBlur& blur, std::size_t boundaries = 4) {
  EllipseEvidence evidence;
  for (std::size_t k = 0; k < boundaries; ++k)
    for (int i = -10; i <= 10; ++i) {
      const Eigen::Vector2d normal = Eigen::Vector2d(1, 0.06 * i + 0.15 * static_cast<double>(k)).normalized();
      const double along = std::abs(normal.x());
      const double off_px =
          (truth.ellipse(k).along_normal_px(normal) - blur.ellipse(k).along_normal_px(normal)) / along;
      const EdgeFit edge{.blur_gradient = 100 * static_cast<float>(off_px), .blur_information = 100};
      evidence.add(edge, 0.01, blur, k, normal);
    }
  return evidence;
}

EdgeBlur oblique_motion(double correlation) {
  EdgeBlur blur{2.5, 3};
  blur.along_px = {1.8, 2.2, 2.5, 3.5}, blur.correlation = correlation;
  return blur;
}

TEST(EdgeBlur, IsFoundFromBoundariesOfSeveralInclinations) {
  for (const double correlation : {-0.9, 0.0, 0.7}) {
    const EdgeBlur truth = oblique_motion(correlation);
    EdgeBlur blur{2, 3};
    for (int i = 0; i < 20; ++i) blur = evidence_of(truth, blur).improved(blur);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(blur.along_px[k], truth.along_px[k], 0.01) << k;
    EXPECT_NEAR(blur.correlation, correlation, 0.02);
  }
}

TEST(EdgeBlur, OfABoundaryThatIsHiddenIsTheOthers) {
  EdgeBlur blur{2, 3};
  for (int i = 0; i < 20; ++i) blur = evidence_of({3, 3}, blur, 3).improved(blur);
  EXPECT_NEAR(blur.along_px[3], 3, 0.05);
}

TEST(EdgeBlur, IsAnEllipseWhateverEdgesSay) {
  Random random(1);
  EdgeBlur blur{2, 3};
  for (int i = 0; i < 200; ++i) {
    EllipseEvidence evidence;
    for (int j = 0; j < 30; ++j) {
      EdgeFit edge;
      edge.blur_information = static_cast<float>(random.uniform(0, 10));
      edge.blur_gradient = static_cast<float>(random.uniform(-100, 100));
      evidence.add(edge, 0.01, blur, static_cast<std::size_t>(j % 4), {1, random.uniform(-3, 3)});
    }
    blur = evidence.improved(blur);
    blur.sides_px = random.uniform(0.5, 8);
    for (std::size_t k = 0; k < 4; ++k) {
      const BlurEllipse ellipse = blur.ellipse(k);
      EXPECT_GT(ellipse.along_px2 * ellipse.across_px2, ellipse.oblique_px2 * ellipse.oblique_px2);
      EXPECT_GE(blur.along_px[k], 0.5);
      EXPECT_LE(blur.along_px[k], 8);
    }
  }
  const EdgeBlur unseen = EllipseEvidence().improved(blur);
  EXPECT_TRUE(std::isfinite(unseen.boundaries_px()) && std::isfinite(unseen.correlation));
}

}  // namespace lapservo::internal::edge_blur_test
