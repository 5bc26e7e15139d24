#include "lapservo/vision/camera/picture_processing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

// The unknowns: the frame's processing, then each pooled edge's.
constexpr std::size_t most_edges = 4 * std::size_t{max_brightness_levels};
struct State {
  ProcessingVector processing;
  std::array<EdgeVector, most_edges> edges;
};

// One sigma of what is expected of any processing before a frame is seen.
constexpr double as_expected = 1e-3;
ProcessingVector expected_sigmas(bool only_video, double of_chroma_shift_px = as_expected) {
  ProcessingVector sigmas;
  using enum ProcessingUnknown::Index;
  sigmas[log_blur] = 0.3, sigmas[log_mosaic] = 0.2, sigmas[chroma_variance] = 0.7;
  sigmas[saturation] = 0.15, sigmas[sharpening] = 0.5, sigmas[log_radius] = 0.25;
  sigmas[chroma_shift_px] = of_chroma_shift_px;
  if (only_video) sigmas[log_mosaic] = sigmas[saturation] = sigmas[sharpening] = as_expected;
  return sigmas;
}
// How far subsampled chroma lies beside its place where a reader takes it for sited elsewhere, or repeats it: half a
// pixel in either direction of the image [px, one sigma along a normal].
constexpr double chroma_beside_px = 0.3;
// The mean of what a shift is where one is fitted. Chroma in its place and chroma beside it are taken for equally
// likely: nobody has counted readers.
double likely_shift_px(double fitted_px) {
  constexpr double fit_sigma_px = 0.05;  // rms of 54 frames in 4:2:0: 0.03, with JPEG of quality 85: 0.07
  const double beside_px = std::hypot(chroma_beside_px, fit_sigma_px);
  const auto density = [&](double sigma_px) {
    return std::exp(-fitted_px * fitted_px / (2 * sigma_px * sigma_px)) / sigma_px;
  };
  return fitted_px * density(beside_px) / (density(beside_px) + density(fit_sigma_px));
}

// The part of an edge's normal equations that concerns itself, and its part in the shared ones.
struct Block {
  Eigen::LLT<Eigen::Matrix<double, edge_unknowns, edge_unknowns>> factor;
  Eigen::Matrix<double, processing_unknowns, edge_unknowns> cross;
  EdgeVector gradient;
};
// An edge's normal equations: of the processing and of itself. Expectations of them are not in.
struct EdgeEquations {
  static constexpr int unknowns = processing_unknowns + edge_unknowns;
  Eigen::Matrix<double, unknowns, unknowns> square;
  Eigen::Matrix<double, unknowns, 1> pull;
};
using AllEdgeEquations = std::array<EdgeEquations, most_edges>;  // of those that are seen
using ProcessingMatrix = Eigen::Matrix<double, processing_unknowns, processing_unknowns>;

// Gauss-Newton with edges eliminated.
class Problem {
 public:
  Problem(const LightTable& light_of_value, const PooledEdges& pooled, double blur_px, const ProcessingVector& sigmas,
          const ExpectedPicture& picture, double chroma_shift_px = 0)
      : light_of_value_(light_of_value),
        edges_(pooled.all),
        certainty_(sigmas.cwiseAbs2().cwiseInverse()),
        least_sharpening_(picture.least_sharpening) {
    constexpr double sharp_px = 1.1;
    prior_.processing.setZero();
    prior_.edges.fill(EdgeVector::Zero());
    prior_.processing[ProcessingUnknown::log_blur] = std::log(std::min(blur_px, sharp_px));
    prior_.processing[ProcessingUnknown::saturation] = 1;
    prior_.processing[ProcessingUnknown::log_radius] = std::log(PictureProcessing{}.sharpening_px);
    prior_.processing[ProcessingUnknown::chroma_shift_px] = chroma_shift_px;
    EdgeVector edge_sigmas = EdgeVector::Constant(0.3);  // clipped values hide their plateau, so that these are wide
    edge_sigmas[edge_gradient] = picture.gradient_sigma_per_px;
    edge_certainty_ = edge_sigmas.cwiseAbs2().cwiseInverse();
    std::array<int, 4> places{};
    for (std::size_t k = 0; k < edges_.size(); ++k)
      if (edges_[k].is_seen()) seen_.push_back(k), places[edges_[k].boundary] += edges_[k].places;
    for (const std::size_t k : seen_) take(k, places[edges_[k].boundary]);
  }
  const State& prior() const { return prior_; }

  // The rest of the values, of each boundary's mean over its levels of brightness: rms.
  double misfit(const State& state) const {
    std::array<EdgeSamples, 4> sum, weight;
    sum.fill(EdgeSamples::Zero()), weight.fill(EdgeSamples::Zero());
    const auto missed = missed_by(state);
    for (const std::size_t k : seen_) {
      sum[edges_[k].boundary] += static_cast<float>(weight_[k]) * missed[k];
      weight[edges_[k].boundary] += static_cast<float>(weight_[k]) * usable_[k];
    }
    float squares = 0, values = 0;
    for (std::size_t k = 0; k < 4; ++k)
      for (int i = 0; i < all_edge_rows; ++i) {
        if (!(weight[k][i] > 0)) continue;
        squares += sum[k][i] * sum[k][i] / (weight[k][i] * weight[k][i]);
        values += 1;
      }
    return std::sqrt(static_cast<double>(squares / std::max(1.0F, values)));
  }
  // For the values and the expectations, in sigmas.
  double cost(const State& state) const {
    double sum = (state.processing - prior_.processing).cwiseAbs2().dot(certainty_);
    for (const std::size_t k : seen_) sum += (state.edges[k] - prior_.edges[k]).cwiseAbs2().dot(edge_certainty_);
    const auto missed = missed_by(state);
    for (const std::size_t k : seen_)
      sum += weight_[k] / (value_sigma * value_sigma) * static_cast<double>(missed[k].squaredNorm());
    return sum;
  }
  void linearise(const State& state, AllEdgeEquations& equations) const {
    const ProcessingFilters filters(processing_of(state.processing), true);
    for (const std::size_t k : seen_) {
      auto [values, jacobian] = linearised_edge(light_of_value_, filters, state.edges[k]);
      const EdgeSamples missed = (measured_[k] - values).cwiseProduct(usable_[k]);
      for (auto by_unknown : jacobian.colwise()) by_unknown = by_unknown.cwiseProduct(usable_[k]).eval();
      const double certainty = weight_[k] / (value_sigma * value_sigma);
      auto& [square, pull] = equations[k];
      for (int a = 0; a < EdgeEquations::unknowns; ++a)
        for (int b = 0; b <= a; ++b)
          square(a, b) = square(b, a) = certainty * static_cast<double>(jacobian.col(a).dot(jacobian.col(b)));
      pull = certainty * jacobian.transpose().lazyProduct(missed).cast<double>();
    }
  }
  State improved(const State& state, const AllEdgeEquations& equations, double damping) const {
    ProcessingMatrix information = certainty_.asDiagonal();
    ProcessingVector gradient = (prior_.processing - state.processing).cwiseProduct(certainty_);
    std::array<Block, most_edges> blocks;
    for (const std::size_t k : seen_) {
      const auto& [square, pull] = equations[k];
      Block& block = blocks[k];
      Eigen::Matrix<double, edge_unknowns, edge_unknowns> of_own =
          square.bottomRightCorner<edge_unknowns, edge_unknowns>();
      of_own.diagonal() *= 1 + damping;
      of_own.diagonal() += edge_certainty_;
      block.factor.compute(of_own);
      block.cross = square.topRightCorner<processing_unknowns, edge_unknowns>();
      block.gradient = pull.tail<edge_unknowns>() + (prior_.edges[k] - state.edges[k]).cwiseProduct(edge_certainty_);
      const Eigen::Matrix<double, edge_unknowns, processing_unknowns> through =
          block.factor.solve(block.cross.transpose());
      information += square.topLeftCorner<processing_unknowns, processing_unknowns>() - block.cross * through;
      gradient += pull.head<processing_unknowns>() - through.transpose() * block.gradient;
    }
    information.diagonal() *= 1 + damping;
    State next = state;
    next.processing += information.llt().solve(gradient);
    const auto bound = [&](int unknown, double least, double most) {
      next.processing[unknown] = std::clamp(next.processing[unknown], least, most);
    };
    bound(ProcessingUnknown::chroma_variance, 0, 3.5);
    bound(ProcessingUnknown::saturation, 0.5, 2);
    bound(ProcessingUnknown::sharpening, least_sharpening_, 2);
    bound(ProcessingUnknown::chroma_shift_px, -1, 1);
    const ProcessingVector taken = next.processing - state.processing;
    for (const std::size_t k : seen_)
      next.edges[k] += blocks[k]
                           .factor.solve(blocks[k].gradient - blocks[k].cross.transpose() * taken)
                           .cwiseMax(-longest_step)
                           .cwiseMin(longest_step);
    return next;
  }

 private:
  static constexpr double value_sigma = 0.0025;  // of one value: noise and what the model leaves out
  // Sigmas of a place [px] and of a plateau: clipped values show of neither how far it goes on.
  static constexpr double longest_step = 0.2;

  // An edge of the boundary that was located at so many places.
  void take(std::size_t k, int places) {
    const PooledEdge& edge = edges_[k];
    const auto first = static_cast<std::size_t>(PooledEdge::reach - edge.clear_px);
    const std::size_t last = PooledEdge::samples - 1 - first;
    weight_[k] = static_cast<double>(edge.places) / places;
    measured_[k].setZero(), usable_[k].setZero(), prior_.edges[k].setZero();
    prior_.edges[k][edge_offset] = edge.residual_px;
    for (int c = 0; c < 3; ++c) {
      const auto& value = edge.value[static_cast<std::size_t>(c)];
      prior_.edges[k][edge_before + c] = static_cast<double>(value[first] + value[first + 1]) / 2;
      prior_.edges[k][edge_after + c] = static_cast<double>(value[last] + value[last - 1]) / 2;
      for (std::size_t i = 0; i < value.size(); ++i) {
        const int row = edge_rows * c + static_cast<int>(i);
        measured_[k][row] = value[i];
        usable_[k][row] = i >= first && i <= last ? 1.0F : 0.0F;
      }
    }
  }
  std::array<EdgeSamples, most_edges> missed_by(const State& state) const {
    const ProcessingFilters filters(processing_of(state.processing), false);
    std::array<EdgeSamples, most_edges> missed;
    for (const std::size_t k : seen_)
      missed[k] = (measured_[k] - processed_edge(light_of_value_, filters, state.edges[k])).cwiseProduct(usable_[k]);
    return missed;
  }

  const LightTable& light_of_value_;
  const decltype(PooledEdges::all)& edges_;
  InplaceVector<std::size_t, most_edges> seen_;  // which of them
  State prior_;
  ProcessingVector certainty_;
  EdgeVector edge_certainty_;
  double least_sharpening_;
  std::array<double, most_edges> weight_;                  // an edge's share of its boundary's places
  std::array<EdgeSamples, most_edges> measured_, usable_;  // usable: 1 or 0
};

bool is_enough(const PooledEdges& edges) {
  std::array<bool, 4> seen{};
  for (const PooledEdge& edge : edges.all) seen[edge.boundary] = seen[edge.boundary] || edge.is_seen();
  return std::count(seen.begin(), seen.end(), true) >= processing_limits.min_boundaries;
}

// Levenberg and Marquardt's way.
State minimised(const Problem& problem, State state) {
  constexpr int max_steps = 15;
  constexpr double settled = 0.005, damping_step = 10;  // of the cost; a factor
  AllEdgeEquations equations;
  problem.linearise(state, equations);
  double cost = problem.cost(state), damping = 1e-3;
  for (int i = 0; i < max_steps; ++i) {
    const State next = problem.improved(state, equations, damping);
    const double next_cost = problem.cost(next);
    if (!(next_cost < cost)) {
      damping *= damping_step;
      continue;
    }
    const bool small = next_cost > (1 - settled) * cost;
    state = next, cost = next_cost, damping /= damping_step;
    if (small) break;
    problem.linearise(state, equations);
  }
  return state;
}

}  // namespace

bool is_processed(const PictureProcessing& p) {
  const ProcessingLimits& limits = processing_limits;
  return p.chroma_variance_px2 > limits.chroma_variance_px2 || p.sharpening > limits.max_sharpening ||
         p.sharpening < limits.min_sharpening || std::abs(p.saturation - 1) > limits.saturation;
}

bool is_believed(const ProcessedEdges& edges) {
  return edges.misfit < processing_limits.max_misfit &&
         edges.misfit < processing_limits.max_misfit_fraction * edges.misfit_without;
}

std::optional<PictureProcessing> first_guess(const LightTable& light_of_value, const PooledEdges& edges,
                                             double blur_px) {
  if (!is_enough(edges)) return std::nullopt;
  const Problem problem(light_of_value, edges, blur_px, expected_sigmas(false), {});
  AllEdgeEquations equations;
  problem.linearise(problem.prior(), equations);
  return processing_of(problem.improved(problem.prior(), equations, 0).processing);
}

std::optional<ProcessedEdges> explain(const LightTable& light_of_value, const PooledEdges& edges, double blur_px,
                                      const ExpectedPicture& expected) {
  if (!is_enough(edges)) return std::nullopt;
  const ProcessingVector sigmas = expected_sigmas(expected.only_video);
  const Problem problem(light_of_value, edges, blur_px, sigmas, expected);
  ProcessingVector sigmas_of_none = ProcessingVector::Constant(1e-4);
  sigmas_of_none[ProcessingUnknown::log_blur] = sigmas[ProcessingUnknown::log_blur];
  const Problem without(light_of_value, edges, blur_px, sigmas_of_none, expected);
  const State none = minimised(without, without.prior());
  State state = minimised(problem, problem.prior());
  // From where the image is expected to be, the way to the least cost may end beside it.
  if (problem.cost(none) < problem.cost(state)) state = minimised(problem, none);
  if (processing_of(state.processing).chroma_variance_px2 > processing_limits.chroma_variance_px2) {
    const ProcessingVector sigmas_beside = expected_sigmas(expected.only_video, chroma_beside_px);
    const State anywhere = minimised(Problem(light_of_value, edges, blur_px, sigmas_beside, expected), state);
    const double shift_px = likely_shift_px(processing_of(anywhere.processing).chroma_shift_px);
    state = minimised(Problem(light_of_value, edges, blur_px, sigmas, expected, shift_px), anywhere);
  }
  ProcessedEdges out;
  out.processing = processing_of(state.processing);
  out.misfit = problem.misfit(state);
  out.misfit_without = without.misfit(none);
  const auto bias_px = [&](std::size_t k) { return edges.all[k].residual_px - state.edges[k][edge_offset]; };
  std::array<double, 4> places{}, sum_px{};
  for (std::size_t k = 0; k < edges.all.size(); ++k) {
    const PooledEdge& edge = edges.all[k];
    if (!edge.is_seen()) continue;
    places[edge.boundary] += edge.places;
    sum_px[edge.boundary] += edge.places * bias_px(k);
    const auto colours = state.edges[k].segment<6>(edge_before);
    out.clips = out.clips || colours.minCoeff() < 0 || colours.maxCoeff() > 1;
  }
  for (std::size_t k = 0; k < 4; ++k)
    if (places[k] > 0) out.bias_px[k] = sum_px[k] / places[k];
  for (std::size_t i = 0; i < edges.of_measurement.size(); ++i)
    if (const std::uint8_t k = edges.of_measurement[i]; k != PooledEdges::nowhere)
      out.measurement_bias_px[i] = static_cast<float>(bias_px(k));
  return out;
}

ProcessingEvidence find_processing(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                                   const ExpectedPicture& expected) {
  if (blur_px > processing_limits.max_blur_px) return {};
  const auto& light_of_value = light.light_of_value();
  const auto guess = first_guess(light_of_value, pool_edges(light, measurements, Look::glance), blur_px);
  if (!guess) return {};
  if (!is_processed(*guess)) return {Processing::none, std::nullopt};
  const PooledEdges edges = pool_edges(light, measurements, Look::closely);
  auto explained = explain(light_of_value, edges, blur_px, expected);
  if (!explained) return {};
  for (std::size_t i = 0; i < measurements.size(); ++i)
    if (measurements[i].group < 4 && edges.of_measurement[i] == PooledEdges::nowhere)
      explained->measurement_bias_px[i] = static_cast<float>(explained->bias_px[measurements[i].group].value_or(0));
  if (explained->misfit_without < processing_limits.max_misfit_of_none) return {Processing::none, std::nullopt, true};
  if (is_believed(*explained)) return {Processing::found, std::move(explained), true};
  return {Processing::unknown, std::nullopt, true};
}

}  // namespace lapservo::internal
