#include "lapservo/vision/luma_offset.h"

#include <algorithm>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

// How luma differs from what is expected: its unknowns and one sigma of each before it is seen.
enum LumaUnknown : int { luma_offset, luma_blur_px2, luma_lift, luma_stretch, luma_gradient };
constexpr int luma_unknowns = luma_gradient + 1;
using LumaVector = Eigen::Matrix<double, luma_unknowns, 1>;
LumaVector luma_sigmas() {
  LumaVector sigmas;
  // A weak edge is blurred by 0.4 px^2 by deblocking, a strong one by 0.1; values are up to two levels too low.
  sigmas[luma_offset] = 0.3, sigmas[luma_blur_px2] = 1, sigmas[luma_lift] = 0.05, sigmas[luma_stretch] = 0.1;
  sigmas[luma_gradient] = 0.03;
  return sigmas;
}
constexpr double luma_sigma = 0.004;  // of a value, a level: what the encoder leaves
constexpr int farthest_luma_px = 5;   // so that each has neighbours

template <typename Samples>
double luma_at(const Samples& samples, int i) {
  double luma = 0;
  for (int c = 0; c < 3; ++c)
    luma += static_cast<double>(luma_of_bgr[static_cast<std::size_t>(c)] * samples[edge_rows * c + i]);
  return luma;
}

}  // namespace

double offset_by_luma_px(const ProcessedEdge::Linearised& model, const EdgeSamples& measured, int clear_px) {
  const EdgeSamples by_offset = model.jacobian.col(processing_unknowns + edge_offset);
  const EdgeSamples by_gradient = model.jacobian.col(processing_unknowns + edge_gradient);
  constexpr int middle = PooledEdge::reach;
  const int reach = std::min(clear_px, farthest_luma_px);
  Eigen::Matrix<double, luma_unknowns, luma_unknowns> information =
      luma_sigmas().cwiseAbs2().cwiseInverse().asDiagonal();
  LumaVector pull = LumaVector::Zero();
  for (int i = middle - reach; i <= middle + reach; ++i) {
    const double expected = luma_at(model.values, i);
    const double bend = luma_at(model.values, i - 1) - 2 * expected + luma_at(model.values, i + 1);
    LumaVector row;
    row << luma_at(by_offset, i), bend / 2, 1, expected, luma_at(by_gradient, i);
    row /= luma_sigma;
    information += row * row.transpose();
    pull += (luma_at(measured, i) - expected) / luma_sigma * row;
  }
  return information.llt().solve(pull)[luma_offset];
}

}  // namespace lapservo::internal
