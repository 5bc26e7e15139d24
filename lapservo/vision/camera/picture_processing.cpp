#include "lapservo/vision/camera/picture_processing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

constexpr double max_chroma_variance_px2 = 3.5;

constexpr int at(ProcessingUnknown unknown) {
  return static_cast<int>(unknown);
}

// The unknowns: the frame's processing, then each pooled edge's.
constexpr std::size_t most_edges = 4 * std::size_t{max_brightness_levels};
struct State {
  ProcessingVector processing;
  std::array<EdgeVector, most_edges> edges;
};

// One sigma of what is expected before a frame is seen: of any processing, of none but blur, of an edge.
ProcessingVector expected_sigmas(bool only_video) {
  constexpr double as_expected = 1e-3;
  ProcessingVector sigmas;
  using enum ProcessingUnknown;
  sigmas[at(log_blur)] = 0.3, sigmas[at(log_mosaic)] = 0.2, sigmas[at(chroma_variance)] = 0.7;
  sigmas[at(saturation)] = 0.15, sigmas[at(sharpening)] = 0.5, sigmas[at(log_radius)] = 0.25;
  sigmas[at(chroma_shift_px)] = as_expected;
  if (only_video) sigmas[at(log_mosaic)] = sigmas[at(saturation)] = sigmas[at(sharpening)] = as_expected;
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
ProcessingVector sigmas_of_none() {
  ProcessingVector sigmas = ProcessingVector::Constant(1e-4);
  const int log_blur = at(ProcessingUnknown::log_blur);
  sigmas[log_blur] = expected_sigmas(false)[log_blur];
  return sigmas;
}
// Clipped values hide their plateau, so that these are wide.
EdgeVector edge_sigmas(const ExpectedPicture& picture) {
  EdgeVector sigmas = EdgeVector::Constant(0.3);
  sigmas[edge_gradient] = picture.gradient_sigma_per_px;
  return sigmas;
}

State expected_state(std::span<const PooledEdge> edges, double blur_px, double chroma_shift_px) {
  constexpr double sharp_px = 1.1;
  State state;
  state.processing.setZero();
  state.processing[at(ProcessingUnknown::log_blur)] = std::log(std::min(blur_px, sharp_px));
  state.processing[at(ProcessingUnknown::saturation)] = 1;
  state.processing[at(ProcessingUnknown::log_radius)] = std::log(PictureProcessing{}.sharpening_px);
  state.processing[at(ProcessingUnknown::chroma_shift_px)] = chroma_shift_px;
  for (std::size_t k = 0; k < edges.size(); ++k) {
    state.edges[k].setZero();
    state.edges[k][edge_offset] = edges[k].residual_px;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& value = edges[k].value[c];
      const auto first = static_cast<std::size_t>(PooledEdge::reach - edges[k].clear_px);
      const std::size_t last = PooledEdge::samples - 1 - first;
      const int channel = static_cast<int>(c);
      state.edges[k][edge_before + channel] = static_cast<double>(value[first] + value[first + 1]) / 2;
      state.edges[k][edge_after + channel] = static_cast<double>(value[last] + value[last - 1]) / 2;
    }
  }
  return state;
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
  Problem(const LightTable& light_of_value, std::span<const PooledEdge> edges, double blur_px,
          const ProcessingVector& sigmas, const ExpectedPicture& picture, double chroma_shift_px = 0)
      : model_(light_of_value),
        edges_(edges),
        prior_(expected_state(edges, blur_px, chroma_shift_px)),
        certainty_(sigmas.cwiseAbs2().cwiseInverse()),
        edge_certainty_(edge_sigmas(picture).cwiseAbs2().cwiseInverse()),
        least_sharpening_(picture.least_sharpening) {
    std::array<int, 4> places{};
    for (const PooledEdge& edge : edges)
      if (edge.is_seen()) places[edge.boundary] += edge.places;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      measured_[k].setZero(), usable_[k].setZero();
      weight_[k] = edges[k].is_seen() ? static_cast<double>(edges[k].places) / places[edges[k].boundary] : 0;
      for (std::size_t c = 0; c < 3; ++c)
        for (int i = 0; i < PooledEdge::samples; ++i) {
          const int row = edge_rows * static_cast<int>(c) + i;
          measured_[k][row] = edges[k].value[c][static_cast<std::size_t>(i)];
          usable_[k][row] = std::abs(i - PooledEdge::reach) <= edges[k].clear_px ? 1.0F : 0.0F;
        }
    }
  }
  const State& prior() const { return prior_; }

  // The rest of the values, of each boundary's mean over its levels of brightness: rms.
  double misfit(const State& state) const {
    std::array<EdgeSamples, 4> sum, weight;
    sum.fill(EdgeSamples::Zero()), weight.fill(EdgeSamples::Zero());
    for_each_missed(state, [&](std::size_t k, const EdgeSamples& missed) {
      sum[edges_[k].boundary] += static_cast<float>(weight_[k]) * missed;
      weight[edges_[k].boundary] += static_cast<float>(weight_[k]) * usable_[k];
    });
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
    for (std::size_t k = 0; k < edges_.size(); ++k)
      sum += (state.edges[k] - prior_.edges[k]).cwiseAbs2().dot(edge_certainty_);
    for_each_missed(state, [&](std::size_t k, const EdgeSamples& missed) {
      sum += weight_[k] / (value_sigma * value_sigma) * static_cast<double>(missed.squaredNorm());
    });
    return sum;
  }
  void linearise(const State& state, AllEdgeEquations& equations) const {
    const PictureProcessing processing = processing_of(state.processing);
    const ProcessingFilters filters(processing, true);
    for (std::size_t k = 0; k < edges_.size(); ++k)
      if (edges_[k].is_seen()) equations_of(k, model_.linearised(filters, processing, state.edges[k]), equations[k]);
  }
  State improved(const State& state, const AllEdgeEquations& equations, double damping) const {
    std::array<Block, most_edges> blocks;
    State next = state;
    next.processing = improved_processing(state, equations, damping, blocks);
    const ProcessingVector taken = next.processing - state.processing;
    for (std::size_t k = 0; k < edges_.size(); ++k)
      if (edges_[k].is_seen())
        next.edges[k] += blocks[k]
                             .factor.solve(blocks[k].gradient - blocks[k].cross.transpose() * taken)
                             .cwiseMax(-longest_step)
                             .cwiseMin(longest_step);
    return next;
  }
  // The first step from what was expected, of the processing only.
  ProcessingVector first_processing() const {
    AllEdgeEquations equations;
    linearise(prior_, equations);
    std::array<Block, most_edges> blocks;
    return improved_processing(prior_, equations, 0, blocks);
  }

 private:
  ProcessingVector improved_processing(const State& state, const AllEdgeEquations& equations, double damping,
                                       std::array<Block, most_edges>& blocks) const {
    ProcessingMatrix information = certainty_.asDiagonal();
    ProcessingVector gradient = (prior_.processing - state.processing).cwiseProduct(certainty_);
    for (std::size_t k = 0; k < edges_.size(); ++k)
      if (edges_[k].is_seen()) eliminate(k, state.edges[k], equations[k], damping, information, gradient, blocks[k]);
    information.diagonal() *= 1 + damping;
    return bounded(state.processing + information.llt().solve(gradient));
  }
  static constexpr double value_sigma = 0.0025;  // of one value: noise and what the model leaves out
  // Sigmas of a place [px] and of a plateau: clipped values show of neither how far it goes on.
  static constexpr double longest_step = 0.2;

  template <typename Function>
  void for_each_missed(const State& state, const Function& function) const {
    const PictureProcessing processing = processing_of(state.processing);
    const ProcessingFilters filters(processing, false);
    for (std::size_t k = 0; k < edges_.size(); ++k)
      if (edges_[k].is_seen()) function(k, missed(k, model_.values(filters, processing, state.edges[k])));
  }
  EdgeSamples missed(std::size_t k, const EdgeSamples& values) const {
    return (measured_[k] - values).cwiseProduct(usable_[k]);
  }
  ProcessingVector bounded(const ProcessingVector& unknowns) const {
    ProcessingVector out = unknowns;
    const auto bound = [&](ProcessingUnknown unknown, double least, double most) {
      out[at(unknown)] = std::clamp(out[at(unknown)], least, most);
    };
    bound(ProcessingUnknown::chroma_variance, 0, max_chroma_variance_px2);
    bound(ProcessingUnknown::saturation, 0.5, 2);
    bound(ProcessingUnknown::sharpening, least_sharpening_, 2);
    bound(ProcessingUnknown::chroma_shift_px, -1, 1);
    return out;
  }
  void equations_of(std::size_t k, const ProcessedEdge::Linearised& model, EdgeEquations& equations) const {
    const EdgeSamples miss = missed(k, model.values);
    auto jacobian = model.jacobian;
    for (auto by_unknown : jacobian.colwise()) by_unknown = by_unknown.cwiseProduct(usable_[k]).eval();
    const double certainty = weight_[k] / (value_sigma * value_sigma);
    for (int a = 0; a < EdgeEquations::unknowns; ++a)
      for (int b = 0; b <= a; ++b)
        equations.square(a, b) = equations.square(b, a) =
            certainty * static_cast<double>(jacobian.col(a).dot(jacobian.col(b)));
    equations.pull = certainty * jacobian.transpose().lazyProduct(miss).template cast<double>();
  }
  void eliminate(std::size_t k, const EdgeVector& edge, const EdgeEquations& equations, double damping,
                 ProcessingMatrix& information, ProcessingVector& gradient, Block& block) const {
    const auto& [square, pull] = equations;
    Eigen::Matrix<double, edge_unknowns, edge_unknowns> of_own =
        square.template bottomRightCorner<edge_unknowns, edge_unknowns>();
    of_own.diagonal() *= 1 + damping;
    of_own.diagonal() += edge_certainty_;
    block.factor.compute(of_own);
    block.cross = square.template topRightCorner<processing_unknowns, edge_unknowns>();
    block.gradient = pull.template tail<edge_unknowns>() + (prior_.edges[k] - edge).cwiseProduct(edge_certainty_);
    const Eigen::Matrix<double, edge_unknowns, processing_unknowns> through =
        block.factor.solve(block.cross.transpose());
    information += square.template topLeftCorner<processing_unknowns, processing_unknowns>() - block.cross * through;
    gradient += pull.template head<processing_unknowns>() - through.transpose() * block.gradient;
  }

  ProcessedEdge model_;
  std::span<const PooledEdge> edges_;
  State prior_;
  ProcessingVector certainty_;
  EdgeVector edge_certainty_;
  double least_sharpening_;
  std::array<double, most_edges> weight_;                  // an edge's share of its boundary's places
  std::array<EdgeSamples, most_edges> measured_, usable_;  // usable: 1 or 0
};

bool is_enough(std::span<const PooledEdge> edges) {
  std::array<bool, 4> seen{};
  for (const PooledEdge& edge : edges) seen[edge.boundary] = seen[edge.boundary] || edge.is_seen();
  return std::count(seen.begin(), seen.end(), true) >= processing_limits.min_boundaries;
}

// Levenberg and Marquardt's way.
State minimised(const Problem& problem, State state) {
  constexpr int max_steps = 15;
  constexpr double settled = 0.005, damping_step = 10;  // of the cost; a factor
  AllEdgeEquations equations;
  bool is_new = true;
  double cost = problem.cost(state), damping = 1e-3;
  for (int i = 0; i < max_steps; ++i) {
    if (std::exchange(is_new, false)) problem.linearise(state, equations);
    const State next = problem.improved(state, equations, damping);
    const double next_cost = problem.cost(next);
    if (!(next_cost < cost)) {
      damping *= damping_step;
      continue;
    }
    const bool small = next_cost > (1 - settled) * cost;
    state = next, cost = next_cost, damping /= damping_step, is_new = true;
    if (small) break;
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
  const std::span<const PooledEdge> all(edges.all.begin(), edges.all.size());
  if (!is_enough(all)) return std::nullopt;
  const Problem problem(light_of_value, all, blur_px, expected_sigmas(false), {});
  return processing_of(problem.first_processing());
}

std::optional<ProcessedEdges> explain(const LightTable& light_of_value, const PooledEdges& edges, double blur_px,
                                      const ExpectedPicture& expected) {
  const std::span<const PooledEdge> all(edges.all.begin(), edges.all.size());
  if (!is_enough(all)) return std::nullopt;
  const ProcessingVector sigmas = expected_sigmas(expected.only_video);
  const Problem problem(light_of_value, all, blur_px, sigmas, expected);
  const Problem without(light_of_value, all, blur_px, sigmas_of_none(), expected);
  const State none = minimised(without, without.prior());
  State state = minimised(problem, problem.prior());
  // From where the image is expected to be, the way to the least cost may end beside it.
  if (problem.cost(none) < problem.cost(state)) state = minimised(problem, none);
  if (processing_of(state.processing).chroma_variance_px2 > processing_limits.chroma_variance_px2) {
    ProcessingVector sigmas_beside = sigmas;
    sigmas_beside[at(ProcessingUnknown::chroma_shift_px)] = chroma_beside_px;
    const State anywhere = minimised(Problem(light_of_value, all, blur_px, sigmas_beside, expected), state);
    const double shift_px = likely_shift_px(processing_of(anywhere.processing).chroma_shift_px);
    state = minimised(Problem(light_of_value, all, blur_px, sigmas, expected, shift_px), anywhere);
  }
  ProcessedEdges out;
  out.processing = processing_of(state.processing);
  out.misfit = problem.misfit(state);
  out.misfit_without = without.misfit(none);
  const auto bias_px = [&](std::size_t k) { return all[k].residual_px - state.edges[k][edge_offset]; };
  std::array<double, 4> places{}, sum_px{};
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!all[k].is_seen()) continue;
    places[all[k].boundary] += all[k].places;
    sum_px[all[k].boundary] += all[k].places * bias_px(k);
    const auto colours = state.edges[k].segment<6>(edge_before);
    out.clips = out.clips || colours.minCoeff() < 0 || colours.maxCoeff() > 1;
  }
  for (std::size_t k = 0; k < 4; ++k)
    if (places[k] > 0) out.bias_px[k] = sum_px[k] / places[k];
  for (std::size_t i = 0; i < edges.of_measurement.size(); ++i) {
    const std::uint8_t k = edges.of_measurement[i];
    if (k == PooledEdges::nowhere) continue;
    out.measurement_bias_px[i] =
        static_cast<float>(all[k].is_seen() ? bias_px(k) : out.bias_px[all[k].boundary].value_or(0));
  }
  return out;
}

std::array<double, 4> bias_magnitudes_px(const ProcessedEdges& edges) {
  double largest_px = 0;
  for (const auto& bias_px : edges.bias_px) largest_px = std::max(largest_px, std::abs(bias_px.value_or(0)));
  std::array<double, 4> magnitudes_px{};
  for (std::size_t k = 0; k < 4; ++k) magnitudes_px[k] = std::abs(edges.bias_px[k].value_or(largest_px));
  return magnitudes_px;
}

PooledEdges glance_at(const LightImage& light, std::span<const Measurement> measurements) {
  constexpr Look glance{12, 1, Between::values};
  return pool_edges(light, measurements, glance);
}

ProcessingEvidence find_processing(const LightImage& light, std::span<const Measurement> measurements,
                                   const PooledEdges& glance, double blur_px, const ExpectedPicture& expected) {
  constexpr Look look{EdgeMeasurements::max_lines, max_brightness_levels, Between::values_cubic};
  if (blur_px > processing_limits.max_blur_px) return {};
  const auto& light_of_value = light.light_of_value();
  const auto guess = first_guess(light_of_value, glance, blur_px);
  if (!guess) return {};
  if (!is_processed(*guess)) return {Processing::none, std::nullopt};
  const PooledEdges edges = pool_edges(light, measurements, look);
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
