#include "lapservo/vision/camera/processed_edge.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/geometry/response.h"
#include "lapservo/vision/camera/test_edges.h"

namespace lapservo::internal::processed_edge_test {

const Eigen::Vector3d green(0.25, 0.75, 0.5), pink(0.8, 0.3, 0.6), grey(0.15, 0.16, 0.15);

ProcessingVector everything() {
  ProcessingVector unknowns;
  using enum ProcessingUnknown::Index;
  unknowns[log_blur] = std::log(1.1), unknowns[chroma_variance] = 0.8;
  unknowns[saturation] = 1.3, unknowns[sharpening] = 0.5;
  unknowns[log_radius] = std::log(1.3), unknowns[log_mosaic] = 0.1;
  unknowns[chroma_shift_px] = 0.4;
  return unknowns;
}

EdgeSamples shown(const ProcessingVector& unknowns, const EdgeVector& edge) {
  return processed_edge(Response{}.table(), ProcessingFilters(processing_of(unknowns), false), edge);
}

// Also where some of it is clipped: red is at black on one side.
TEST(ProcessedEdge, DerivativesAreThoseOfTheValues) {
  const ProcessingVector unknowns = everything();
  const PictureProcessing processing = processing_of(unknowns);
  EdgeVector edge = edge_of(processing, green, Eigen::Vector3d(0.7, 0.6, 0.14), 0.13);
  edge[edge_gradient] = 0.01;
  const LinearisedEdge model = linearised_edge(Response{}.table(), ProcessingFilters(processing, true), edge);
  EXPECT_LT((model.values - shown(unknowns, edge)).cwiseAbs().maxCoeff(), 1e-5F);
  constexpr double step = 4e-3;
  for (int i = 0; i < processing_unknowns + edge_unknowns; ++i) {
    ProcessingVector more = unknowns, less = unknowns;
    EdgeVector edge_more = edge, edge_less = edge;
    (i < processing_unknowns ? more[i] : edge_more[i - processing_unknowns]) += step;
    (i < processing_unknowns ? less[i] : edge_less[i - processing_unknowns]) -= step;
    const EdgeSamples numeric = (shown(more, edge_more) - shown(less, edge_less)) / static_cast<float>(2 * step);
    const EdgeSamples analytic = model.jacobian.col(i);
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < PooledEdge::samples; ++k) {
        const int row = edge_rows * c + k;
        EXPECT_NEAR(analytic[row], numeric[row], 0.02 * numeric.cwiseAbs().maxCoeff() + 2e-3) << i << ", " << row;
      }
  }
}

// The effect of saturation on constant light is in what is shown, so a change of it moves no plateau.
TEST(ProcessedEdge, PlateausAreAsShown) {
  ProcessingVector unknowns = everything();
  EdgeVector edge;
  edge << 0, pink, grey, 0;
  for (const double saturation : {0.8, 1.0, 1.6}) {
    unknowns[ProcessingUnknown::saturation] = saturation;
    const EdgeSamples values = shown(unknowns, edge);
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(values[edge_rows * c], pink[c], 3e-3);
      EXPECT_NEAR(values[edge_rows * c + PooledEdge::samples - 1], grey[c], 3e-3);
    }
  }
}

TEST(ProcessedEdge, ShowsNothingBelowBlackOrAboveWhite) {
  ProcessingVector unknowns = everything();
  unknowns[ProcessingUnknown::saturation] = 2;
  const EdgeVector edge = edge_of(processing_of(unknowns), Eigen::Vector3d(0.02, 0.95, 0.9), pink, 0);
  EXPECT_LT(edge.minCoeff(), -0.3);
  EXPECT_GT(edge.maxCoeff(), 1);
  const EdgeSamples values = shown(unknowns, edge);
  EXPECT_GE(values.minCoeff(), 0);
  EXPECT_LE(values.maxCoeff(), 1);
}

// The lights of the lowest tenth of the values are all 0 in single precision.
TEST(ProcessedEdge, IsFiniteWhereValuesShareALight) {
  const LightTable table = Response{Response::Kind::table, 1, {0, 1e-60, 1}, {0, 0.1, 1}}.table();
  const ProcessingFilters filters(processing_of(everything()), true);
  const Eigen::Vector3d dark = Eigen::Vector3d::Constant(0.05);
  for (const Eigen::Vector3d& after : {dark, pink}) {
    EdgeVector edge;
    edge << 0, dark, after, 0;
    const LinearisedEdge model = linearised_edge(table, filters, edge);
    EXPECT_TRUE(model.values.allFinite());
    EXPECT_TRUE(model.jacobian.allFinite());
  }
  EdgeVector even;
  even << 0, dark, dark, 0;
  EXPECT_NEAR(processed_edge(table, filters, even)[0], 12 / 255.0, 1e-3);
}

}  // namespace lapservo::internal::processed_edge_test
