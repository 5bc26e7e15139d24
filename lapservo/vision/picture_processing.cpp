#include "lapservo/vision/picture_processing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Cholesky>

#include "lapservo/vision/blurred_edges.h"
#include "lapservo/vision/edge_profile.h"
#include "lapservo/vision/limits.h"

namespace lapservo::internal {
namespace {

// Filters of encoded values, symmetric: the taps from the middle on, a pixel apart. One of an unsharp mask or of
// chroma's blur reaches 4 px, both together 8.
constexpr int filter_reach = 4, both_reach = 2 * filter_reach;
constexpr int samples = PooledEdge::samples, grid = samples + 2 * both_reach, half_grid = grid / 2;
constexpr double max_chroma_variance_px2 = 3.5;
template <int Reach>
using Taps = std::array<double, Reach + 1>;
using Filter = Taps<filter_reach>;
using BothFilters = Taps<both_reach>;

Filter gaussian(double sigma_px) {
  Filter filter;
  double sum = 0;
  for (std::size_t i = 0; i < filter.size(); ++i) {
    const double x = static_cast<double>(i) / sigma_px;
    filter[i] = std::exp(-x * x / 2);
    sum += i == 0 ? filter[i] : 2 * filter[i];
  }
  for (double& tap : filter) tap /= sum;
  return filter;
}

// Four passes over neighbours: linear in the variance near none.
Filter chroma_blur(double variance_px2) {
  const double side = variance_px2 / 8;
  Filter filter{1, 0, 0, 0, 0};
  for (int pass = 0; pass < filter_reach; ++pass) {
    const Filter before = filter;
    for (std::size_t i = 0; i < filter.size(); ++i) {
      const double inner = before[i == 0 ? 1 : i - 1], outer = i + 1 < before.size() ? before[i + 1] : 0;
      filter[i] = (1 - 2 * side) * before[i] + side * (inner + outer);
    }
  }
  return filter;
}

BothFilters convolved(const Filter& a, const Filter& b, double factor) {
  BothFilters both{};
  const auto tap = [](const Filter& filter, int i) {
    return std::abs(i) <= filter_reach ? filter[static_cast<std::size_t>(std::abs(i))] : 0;
  };
  for (int i = 0; i <= both_reach; ++i)
    for (int k = -filter_reach; k <= filter_reach; ++k) both[static_cast<std::size_t>(i)] += tap(a, k) * tap(b, i - k);
  for (double& t : both) t *= factor;
  return both;
}

template <typename A, typename Function>
A mapped(const A& a, const A& b, const Function& function) {
  A out;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = function(a[i], b[i]);
  return out;
}

// Filtered samples; rows beyond the samples fill a register. Values on the grid, with room for these.
constexpr int rows = 16, padded_grid = rows + 2 * both_reach;
using Samples = Eigen::Matrix<float, rows, 1>;
using SamplesBgr = Eigen::Matrix<float, rows, 3>;
using OnGrid = Eigen::Matrix<float, padded_grid, 3>;

template <std::size_t Size>
SamplesBgr filtered(const std::array<double, Size>& taps, const OnGrid& values) {
  SamplesBgr out = static_cast<float>(taps[0]) * values.middleRows<rows>(both_reach);
  for (int k = 1; k < static_cast<int>(Size); ++k)
    out += static_cast<float>(taps[static_cast<std::size_t>(k)]) *
           (values.middleRows<rows>(both_reach - k) + values.middleRows<rows>(both_reach + k));
  return out;
}

// What the processing does to luma and to colour differences, and with `derivatives` how that changes.
struct Filters {
  Filter luma, luma_by_sharpening, luma_by_radius;
  BothFilters chroma, chroma_by_sharpening, chroma_by_radius, chroma_by_variance;

  Filters(const PictureProcessing& p, bool derivatives) {
    constexpr double step = 1e-2;
    const Filter none{1, 0, 0, 0, 0}, mask = gaussian(p.sharpening_px), blur = chroma_blur(p.chroma_variance_px2);
    const Filter by_amount = mapped(none, mask, [](double a, double b) { return a - b; });
    const Filter sharpened = mapped(none, by_amount, [&](double a, double b) { return a + p.sharpening * b; });
    luma = sharpened;
    chroma = convolved(sharpened, blur, p.saturation);
    if (!derivatives) return;
    const Filter wider = gaussian(p.sharpening_px * (1 + step));
    const Filter by_radius = mapped(mask, wider, [&](double a, double b) { return p.sharpening * (a - b) / step; });
    const Filter blurrier = chroma_blur(p.chroma_variance_px2 + step);
    const Filter by_variance = mapped(blur, blurrier, [&](double a, double b) { return (b - a) / step; });
    luma_by_sharpening = by_amount;
    chroma_by_sharpening = convolved(by_amount, blur, p.saturation);
    luma_by_radius = by_radius;
    chroma_by_radius = convolved(by_radius, blur, p.saturation);
    chroma_by_variance = convolved(sharpened, by_variance, p.saturation);
  }
};

// Rec. 601's luma of b, g, r. A colour difference is a channel less luma, so a processed channel is
// luma(filtered for luma) + channel(filtered for chroma) - luma(filtered for chroma).
constexpr std::array<float, 3> luma_of{0.114F, 0.587F, 0.299F};

// The response both ways, with slopes.
class Encoding {
 public:
  explicit Encoding(const std::array<float, 256>& light_of_value) : light_(light_of_value) {}

  struct At {
    float y, slope;
  };
  At light(double value) const {
    const float place = 255 * static_cast<float>(std::clamp(value, 0.0, 1.0));
    const std::size_t i = std::min<std::size_t>(254, static_cast<std::size_t>(place));
    const float step = light_[i + 1] - light_[i];
    return {light_[i] + (place - static_cast<float>(i)) * step, 255 * step};
  }
  // `near`: an index to look from, which stays near the last light's.
  At value(float light, std::size_t& near) const {
    while (near < 254 && light_[near + 1] < light) ++near;
    while (near > 0 && light_[near] > light) --near;
    const float step = light_[near + 1] - light_[near];
    const float fraction = std::clamp((light - light_[near]) / step, 0.0F, 1.0F);
    return {(static_cast<float>(near) + fraction) / 255, 1 / (255 * step)};
  }

 private:
  const std::array<float, 256>& light_;
};

bool is_seen(const PooledEdge& edge) {
  constexpr int least_clear_px = 3;
  return edge.places >= processing_limits.min_places && edge.clear_px >= least_clear_px;
}

// The unknowns: the frame's processing, then for each boundary its place and both plateaus.
constexpr int shared = 5, own = 7;
enum Shared : int { log_blur, chroma_variance, saturation, sharpening, log_radius };
using SharedVector = Eigen::Matrix<double, shared, 1>;
using OwnVector = Eigen::Matrix<double, own, 1>;
struct State {
  SharedVector processing;
  std::array<OwnVector, 4> boundaries;  // offset, plateaus before, after
};

// The encoded light on the grid, a column for each of b, g, r, and its changes.
struct Encoded {
  OnGrid value = OnGrid::Zero(), by_offset = OnGrid::Zero(), by_blur = OnGrid::Zero(), by_before = OnGrid::Zero(),
         by_after = OnGrid::Zero();
};

Encoded encode(const Encoding& encoding, double blur_px, const OwnVector& boundary) {
  const BlurredEdges& edges = BlurredEdges::instance();
  std::array<BlurredEdge, grid> blurred;
  const auto inverse_blur = static_cast<float>(1 / blur_px), offset_px = static_cast<float>(boundary[0]);
  const auto place = [&](int i) { return (static_cast<float>(i - half_grid) - offset_px) * inverse_blur; };
  for (int i = 0; i < grid; ++i) blurred[static_cast<std::size_t>(i)] = edges.at(place(i));
  Encoded out;
  for (int c = 0; c < 3; ++c) {
    const auto before = encoding.light(boundary[1 + c]), after = encoding.light(boundary[4 + c]);
    const float step = after.y - before.y;
    std::size_t near = static_cast<std::size_t>(255 * std::clamp(boundary[1 + c], 0.0, 0.99));
    for (int i = 0; i < grid; ++i) {
      const BlurredEdge& edge = blurred[static_cast<std::size_t>(i)];
      const auto at = encoding.value(before.y + edge.step * step, near);
      const float moved = -at.slope * step * edge.density;
      out.value(i, c) = at.y;
      out.by_offset(i, c) = moved * inverse_blur;
      out.by_blur(i, c) = moved * place(i);
      out.by_before(i, c) = at.slope * (1 - edge.step) * before.slope;
      out.by_after(i, c) = at.slope * edge.step * after.slope;
    }
  }
  return out;
}

PictureProcessing processing_of(const SharedVector& s) {
  return {std::exp(s[log_blur]), s[chroma_variance], s[saturation], s[sharpening], std::exp(s[log_radius])};
}

// The samples of the three channels below one another.
constexpr int all_rows = 3 * rows;
using AllSamples = Eigen::Matrix<float, all_rows, 1>;
using Jacobian = Eigen::Matrix<float, all_rows, shared + own>;

// Filtered samples of all channels from what is filtered for luma and for chroma, a column a channel.
AllSamples mixed(const SamplesBgr& for_luma, const SamplesBgr& for_chroma) {
  Samples common = Samples::Zero();
  for (int c = 0; c < 3; ++c) common += luma_of[static_cast<std::size_t>(c)] * (for_luma.col(c) - for_chroma.col(c));
  AllSamples out;
  for (int c = 0; c < 3; ++c) out.segment<rows>(rows * c) = common + for_chroma.col(c);
  return out;
}

AllSamples predicted(const Filters& filters, const OnGrid& value) {
  return mixed(filtered(filters.luma, value), filtered(filters.chroma, value));
}

Jacobian derivatives(const Filters& filters, const Encoded& encoded, double saturated_by) {
  const SamplesBgr none = SamplesBgr::Zero(), chroma = filtered(filters.chroma, encoded.value);
  Jacobian out;
  out.col(log_blur) = predicted(filters, encoded.by_blur);
  out.col(chroma_variance) = mixed(none, filtered(filters.chroma_by_variance, encoded.value));
  out.col(saturation) = mixed(none, chroma / static_cast<float>(saturated_by));
  out.col(sharpening) =
      mixed(filtered(filters.luma_by_sharpening, encoded.value), filtered(filters.chroma_by_sharpening, encoded.value));
  out.col(log_radius) =
      mixed(filtered(filters.luma_by_radius, encoded.value), filtered(filters.chroma_by_radius, encoded.value));
  out.col(shared) = predicted(filters, encoded.by_offset);
  const auto plateau = [&](const OnGrid& by, int first) {
    const SamplesBgr for_luma = filtered(filters.luma, by), for_chroma = filtered(filters.chroma, by);
    for (int c = 0; c < 3; ++c) {
      SamplesBgr one_luma = none, one_chroma = none;
      one_luma.col(c) = for_luma.col(c), one_chroma.col(c) = for_chroma.col(c);
      out.col(first + c) = mixed(one_luma, one_chroma);
    }
  };
  plateau(encoded.by_before, shared + 1);
  plateau(encoded.by_after, shared + 4);
  return out;
}

// One sigma of what is expected before a frame is seen: of any processing, of none but blur, of a boundary.
SharedVector expected_sigmas() {
  SharedVector sigmas;
  sigmas << 0.3, 0.7, 0.15, 0.5, 0.25;
  return sigmas;
}
SharedVector sigmas_of_none() {
  SharedVector sigmas = SharedVector::Constant(1e-4);
  sigmas[log_blur] = 0.3;
  return sigmas;
}
// What is clipped at black hides its plateau, so that these are wide.
OwnVector own_sigmas() {
  OwnVector sigmas = OwnVector::Constant(0.3);
  sigmas[0] = 0.3;
  return sigmas;
}

State expected(const PooledEdges& edges, double blur_px) {
  constexpr double sharp_px = 1.1, radius_px = 1.2;
  State state;
  state.processing << std::log(std::min(blur_px, sharp_px)), 0, 1, 0, std::log(radius_px);
  for (std::size_t k = 0; k < 4; ++k) {
    state.boundaries[k][0] = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto& value = edges[k].value[c];
      const auto first = static_cast<std::size_t>(PooledEdge::reach - edges[k].clear_px), last = samples - 1 - first;
      state.boundaries[k][1 + static_cast<int>(c)] = static_cast<double>(value[first] + value[first + 1]) / 2;
      state.boundaries[k][4 + static_cast<int>(c)] = static_cast<double>(value[last] + value[last - 1]) / 2;
    }
  }
  return state;
}

// Of a boundary's normal equations what concerns itself, and its part in the shared ones.
struct Block {
  Eigen::Matrix<double, own, own> inverse;
  Eigen::Matrix<double, shared, own> cross;
  OwnVector gradient;
};

// Gauss-Newton with boundaries eliminated.
class Problem {
 public:
  Problem(const std::array<float, 256>& light_of_value, const PooledEdges& edges, double blur_px,
          const SharedVector& sigmas, double least_sharpening = least_sharpening_known)
      : encoding_(light_of_value),
        edges_(edges),
        prior_(expected(edges, blur_px)),
        certainty_(sigmas.cwiseAbs2().cwiseInverse()),
        least_sharpening_(least_sharpening) {
    for (std::size_t k = 0; k < 4; ++k)
      for (std::size_t c = 0; c < 3; ++c)
        for (int i = 0; i < samples; ++i) {
          const float value = edges[k].value[c][static_cast<std::size_t>(i)];
          const int row = rows * static_cast<int>(c) + i;
          measured_[k][row] = value;
          usable_[k][row] = value < saturated && std::abs(i - PooledEdge::reach) <= edges[k].clear_px ? 1.0F : 0.0F;
        }
  }
  const State& prior() const { return prior_; }

  // Of the values alone, and with what the prior adds, in sigmas.
  double squares(const State& state) const {
    const Filters filters(processing_of(state.processing), false);
    double sum = 0;
    for (std::size_t k = 0; k < 4; ++k)
      if (is_seen(edges_[k]))
        sum += static_cast<double>(
            missed(k, predicted(filters,
                                encode(encoding_, std::exp(state.processing[log_blur]), state.boundaries[k]).value))
                .squaredNorm());
    return sum;
  }
  double misfit(const State& state) const {
    float values = 0;
    for (std::size_t k = 0; k < 4; ++k)
      if (is_seen(edges_[k])) values += usable_[k].sum();
    return std::sqrt(squares(state) / std::max(1.0F, values));
  }
  double cost(const State& state) const {
    double sum = squares(state) / (value_sigma * value_sigma) +
                 (state.processing - prior_.processing).cwiseAbs2().dot(certainty_);
    for (std::size_t k = 0; k < 4; ++k)
      sum += (state.boundaries[k] - prior_.boundaries[k]).cwiseQuotient(own_sigmas()).squaredNorm();
    return sum;
  }
  State improved(const State& state, double damping) const {
    Eigen::Matrix<double, shared, shared> information = certainty_.asDiagonal();
    SharedVector gradient = (prior_.processing - state.processing).cwiseProduct(certainty_);
    const PictureProcessing processing = processing_of(state.processing);
    const Filters filters(processing, true);
    std::array<Block, 4> blocks;
    for (std::size_t k = 0; k < 4; ++k)
      if (is_seen(edges_[k])) blocks[k] = eliminated(state, k, processing, filters, damping, information, gradient);
    Eigen::Matrix<double, shared, shared> damped = information;
    damped.diagonal() *= 1 + damping;
    const SharedVector step = damped.llt().solve(gradient);
    State next = state;
    next.processing += step;
    next.processing[chroma_variance] = std::clamp(next.processing[chroma_variance], 0.0, max_chroma_variance_px2);
    next.processing[saturation] = std::clamp(next.processing[saturation], 0.5, 2.0);
    next.processing[sharpening] = std::clamp(next.processing[sharpening], least_sharpening_, 2.0);
    const SharedVector taken = next.processing - state.processing;
    for (std::size_t k = 0; k < 4; ++k)
      if (is_seen(edges_[k]))
        next.boundaries[k] += blocks[k].inverse * (blocks[k].gradient - blocks[k].cross.transpose() * taken);
    return next;
  }

 private:
  static constexpr double value_sigma = 0.0025;  // of one value: noise and what the model leaves out
  static constexpr float saturated = 0.97F;      // some of the places had no more to show

  AllSamples missed(std::size_t k, const AllSamples& predicted_values) const {
    AllSamples miss = measured_[k] - predicted_values.cwiseMax(0.0F).cwiseMin(1.0F);
    return miss.cwiseProduct(usable_[k]);
  }
  Block eliminated(const State& state, std::size_t k, const PictureProcessing& processing, const Filters& filters,
                   double damping, Eigen::Matrix<double, shared, shared>& information, SharedVector& gradient) const {
    const Encoded encoded = encode(encoding_, processing.blur_px, state.boundaries[k]);
    const AllSamples values = predicted(filters, encoded.value), miss = missed(k, values);
    Jacobian jacobian = derivatives(filters, encoded, processing.saturation);
    for (int i = 0; i < all_rows; ++i)
      if (!(values[i] > 0 && values[i] < 1) || usable_[k][i] == 0) jacobian.row(i).setZero();
    constexpr double certainty = 1 / (value_sigma * value_sigma);
    Eigen::Matrix<double, shared + own, shared + own> square;
    for (int a = 0; a < shared + own; ++a)
      for (int b = 0; b <= a; ++b)
        square(a, b) = square(b, a) = certainty * static_cast<double>(jacobian.col(a).dot(jacobian.col(b)));
    const Eigen::Matrix<double, shared + own, 1> pull =
        certainty * jacobian.transpose().lazyProduct(miss).cast<double>();
    const OwnVector own_certainty = own_sigmas().cwiseAbs2().cwiseInverse();
    Eigen::Matrix<double, own, own> of_own = square.bottomRightCorner<own, own>();
    of_own.diagonal() *= 1 + damping;
    of_own.diagonal() += own_certainty;
    Block block;
    block.inverse = of_own.llt().solve(Eigen::Matrix<double, own, own>::Identity());
    block.cross = square.topRightCorner<shared, own>();
    block.gradient = pull.tail<own>() + (prior_.boundaries[k] - state.boundaries[k]).cwiseProduct(own_certainty);
    const Eigen::Matrix<double, shared, own> through = block.cross * block.inverse;
    information += square.topLeftCorner<shared, shared>() - through * block.cross.transpose();
    gradient += pull.head<shared>() - through * block.gradient;
    return block;
  }

  Encoding encoding_;
  const PooledEdges& edges_;
  State prior_;
  SharedVector certainty_;
  double least_sharpening_;
  std::array<AllSamples, 4> measured_{AllSamples::Zero(), AllSamples::Zero(), AllSamples::Zero(), AllSamples::Zero()};
  std::array<AllSamples, 4> usable_ = measured_;  // 1 or 0
};

// By which fit_step mislocates the edge of these values, which lies at the middle sample.
double fitted_offset_px(const std::array<float, 256>& light_of_value, const EdgeValues& values, double blur_px) {
  EdgeProfile profile;
  const int reach = std::min(PooledEdge::reach, static_cast<int>(2.5 * blur_px + 2));
  profile.first_px = static_cast<float>(-reach);
  profile.count = static_cast<std::size_t>(2 * reach + 1);
  const Encoding encoding(light_of_value);
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < profile.count; ++i) {
      const float value = values[c][i + static_cast<std::size_t>(PooledEdge::reach - reach)];
      profile.light[c][i] = encoding.light(static_cast<double>(value)).y;
      profile.usable[c][i] = 255 * value < LightImage::saturated_value;
    }
  const EdgeFit fit = fit_step(profile, static_cast<float>(blur_px), 5);
  return fit.converged ? static_cast<double>(fit.offset_px) : 0;
}

EdgeValues values_of(const AllSamples& samples_of_all) {
  EdgeValues out;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 0; i < samples; ++i)
      out[c][i] = std::clamp(samples_of_all[static_cast<int>(rows * c + i)], 0.0F, 1.0F);
  return out;
}

bool is_enough(const PooledEdges& edges) {
  return std::count_if(edges.begin(), edges.end(), is_seen) >= processing_limits.min_boundaries;
}

// Levenberg and Marquardt's way.
State minimised(const Problem& problem) {
  constexpr int max_steps = 8;
  constexpr double settled = 0.02;  // of the cost
  State state = problem.prior();
  double cost = problem.cost(state), damping = 1e-3;
  for (int i = 0; i < max_steps; ++i) {
    const State next = problem.improved(state, damping);
    const double next_cost = problem.cost(next);
    if (!(next_cost < cost)) {
      damping *= 10;
      continue;
    }
    const bool small = next_cost > (1 - settled) * cost;
    state = next, cost = next_cost, damping /= 10;
    if (small) break;
  }
  return state;
}

}  // namespace

EdgeValues processed_edge(const std::array<float, 256>& light_of_value, const PictureProcessing& processing,
                          const Plateaus& plateaus, double offset_px) {
  OwnVector boundary;
  boundary << offset_px, plateaus.before[0], plateaus.before[1], plateaus.before[2], plateaus.after[0],
      plateaus.after[1], plateaus.after[2];
  const Encoded encoded = encode(Encoding(light_of_value), processing.blur_px, boundary);
  return values_of(predicted(Filters(processing, false), encoded.value));
}

std::vector<std::array<double, 3>> filtered_light(const std::array<float, 256>& light_of_value,
                                                  const PictureProcessing& processing,
                                                  std::span<const std::array<double, 3>> light) {
  PictureProcessing unsaturated = processing;
  unsaturated.saturation = 1;
  const Filters filters(unsaturated, false);
  const Encoding encoding(light_of_value);
  std::vector<std::array<double, 3>> differences(light.size()), out(light.size());  // to luma
  std::vector<double> luma(light.size());
  std::size_t near = 128;
  for (std::size_t i = 0; i < light.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      differences[i][c] = static_cast<double>(encoding.value(static_cast<float>(light[i][c]), near).y);
      luma[i] += static_cast<double>(luma_of[c]) * differences[i][c];
    }
    for (double& difference : differences[i]) difference -= luma[i];
  }
  const auto last = static_cast<std::ptrdiff_t>(light.size()) - 1;
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    std::array<double, 3> value{};
    for (std::ptrdiff_t k = -both_reach; k <= both_reach; ++k) {
      const auto at = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, last));
      const auto tap = static_cast<std::size_t>(std::abs(k));
      for (std::size_t c = 0; c < 3; ++c)
        value[c] += (tap <= filter_reach ? filters.luma[tap] * luma[at] : 0) + filters.chroma[tap] * differences[at][c];
    }
    for (std::size_t c = 0; c < 3; ++c)
      out[static_cast<std::size_t>(i)][c] = static_cast<double>(encoding.light(value[c]).y);
  }
  return out;
}

bool is_processed(const PictureProcessing& p) {
  const ProcessingLimits& limits = processing_limits;
  return p.chroma_variance_px2 > limits.chroma_variance_px2 || p.sharpening > limits.max_sharpening ||
         p.sharpening < limits.min_sharpening || std::abs(p.saturation - 1) > limits.saturation;
}

bool is_believed(const ProcessedEdges& edges) {
  return edges.misfit < processing_limits.max_misfit &&
         edges.misfit < processing_limits.max_misfit_fraction * edges.misfit_without;
}

std::optional<PictureProcessing> first_guess(const std::array<float, 256>& light_of_value, const PooledEdges& edges,
                                             double blur_px) {
  if (!is_enough(edges)) return std::nullopt;
  const Problem problem(light_of_value, edges, blur_px, expected_sigmas());
  return processing_of(problem.improved(problem.prior(), 0).processing);
}

std::optional<ProcessedEdges> explain(const std::array<float, 256>& light_of_value, const PooledEdges& edges,
                                      double blur_px, double least_sharpening) {
  if (!is_enough(edges)) return std::nullopt;
  const Problem problem(light_of_value, edges, blur_px, expected_sigmas(), least_sharpening);
  const Problem without(light_of_value, edges, blur_px, sigmas_of_none());
  const State state = minimised(problem);
  ProcessedEdges out;
  out.processing = processing_of(state.processing);
  out.misfit = problem.misfit(state);
  out.misfit_without = without.misfit(minimised(without));
  const Filters filters(out.processing, false);
  for (std::size_t k = 0; k < 4; ++k) {
    if (!is_seen(edges[k])) continue;
    OwnVector centred = state.boundaries[k];
    centred[0] = 0;
    const Encoded encoded = encode(Encoding(light_of_value), out.processing.blur_px, centred);
    out.bias_px[k] = fitted_offset_px(light_of_value, values_of(predicted(filters, encoded.value)), blur_px);
  }
  return out;
}

double unexplained_share(const ProcessedEdges& edges) {
  const double usual = fine_fit_limits.usual_misfit * fine_fit_limits.usual_misfit;
  const double left = edges.misfit * edges.misfit - usual;
  const double all = edges.misfit_without * edges.misfit_without - usual;
  return left > 0 ? std::sqrt(std::min(1.0, left / std::max(all, left))) : 0;
}

std::array<double, 4> bias_magnitudes_px(const ProcessedEdges& edges) {
  double largest_px = 0;
  for (const auto& bias_px : edges.bias_px) largest_px = std::max(largest_px, std::abs(bias_px.value_or(0)));
  std::array<double, 4> magnitudes_px{};
  for (std::size_t k = 0; k < 4; ++k) magnitudes_px[k] = std::abs(edges.bias_px[k].value_or(largest_px));
  return magnitudes_px;
}

ProcessingEvidence find_processing(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                                   double least_sharpening) {
  constexpr int glance = 12, look = EdgeMeasurements::max_lines;  // places of a boundary
  if (blur_px > processing_limits.max_blur_px) return {};
  const auto& light_of_value = light.light_of_value();
  const auto guess = first_guess(light_of_value, pool_edges(light, measurements, glance), blur_px);
  if (!guess) return {};
  if (!is_processed(*guess)) return {Processing::none, std::nullopt};
  auto explained = explain(light_of_value, pool_edges(light, measurements, look), blur_px, least_sharpening);
  if (!explained) return {};
  if (is_believed(*explained)) return {Processing::found, std::move(explained)};
  if (explained->misfit_without < processing_limits.max_misfit_of_none) return {Processing::none, std::nullopt};
  return {};
}

}  // namespace lapservo::internal
