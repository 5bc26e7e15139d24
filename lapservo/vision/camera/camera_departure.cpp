#include "lapservo/vision/camera/camera_departure.h"

#include <algorithm>
#include <functional>

#include <Eigen/LU>

#include "lapservo/vision/camera/processed_edge.h"
#include "lapservo/vision/edges/blurred_edges.h"

namespace lapservo::internal {
namespace {

constexpr const DepartureLimits& believed = departure_limits;

// A step at the samples of an edge, about its mean; and its density, which moves it, apart from step and mean.
struct StepColumns {
  const PooledEdge& edge;
  float blur_px;
  std::array<float, PooledEdge::samples> step, density;
  std::size_t first, last;
  float step_square = 0, density_square = 0;

  StepColumns(const PooledEdge& of_edge, float of_blur_px) : edge(of_edge), blur_px(of_blur_px) {
    const int reach = std::min(edge.clear_px, believed.reach_px);
    first = static_cast<std::size_t>(PooledEdge::reach - reach);
    last = static_cast<std::size_t>(PooledEdge::reach + reach);
    const BlurredEdges& edges = BlurredEdges::instance();
    const float from_edge = static_cast<float>(-PooledEdge::reach) - static_cast<float>(edge.residual_px);
    float step_sum = 0, density_sum = 0, both = 0;
    for (std::size_t i = first; i <= last; ++i) {
      const BlurredEdge at = edges.at((from_edge + static_cast<float>(i)) / blur_px);
      step[i] = at.step, density[i] = at.density;
      step_sum += at.step, density_sum += at.density;
    }
    const float per_sample = 1 / static_cast<float>(last - first + 1);
    for (std::size_t i = first; i <= last; ++i) {
      step[i] -= per_sample * step_sum, density[i] -= per_sample * density_sum;
      step_square += step[i] * step[i], both += step[i] * density[i];
    }
    for (std::size_t i = first; i <= last; ++i) {
      density[i] -= both / step_square * step[i];
      density_square += density[i] * density[i];
    }
  }
};

using Channels = Eigen::Array3d;  // b, g, r

// Where each channel shows an edge, from where all of them do, and how much its light changes there.
struct ChannelSteps {
  Channels offset_px, step;
  Channels gloss_px = Channels::Zero();  // by how much specular light and shading may move each
};

// `raised`: a function of the samples' light.
template <typename Raised>
ChannelSteps channel_steps(const StepColumns& columns, const Raised& raised) {
  Channels step, density;
  for (std::size_t c = 0; c < 3; ++c) {
    float by_step = 0, by_density = 0;
    for (std::size_t i = columns.first; i <= columns.last; ++i) {
      const float light = raised(columns.edge.value[c][i]);
      by_step += columns.step[i] * light, by_density += columns.density[i] * light;
    }
    const auto channel = static_cast<Eigen::Index>(c);
    step[channel] = static_cast<double>(by_step / columns.step_square);
    density[channel] = static_cast<double>(by_density / columns.density_square);
  }
  const auto blur_px = static_cast<double>(columns.blur_px);
  ChannelSteps out{-blur_px * density / step - columns.edge.channel_px, step};
  // Specular light is white: it shows alone in a channel in which both sides of the edge look alike.
  Eigen::Index alike = 0;
  if (step.abs().minCoeff(&alike) < believed.least_step * step.abs().maxCoeff())
    out.gloss_px = blur_px * std::abs(density[alike]) / step.abs();
  return out;
}

struct SeenBoundary {
  std::size_t boundary;
  double radial_px;                   // how far from the principal point it lies along its normal
  Channels offset_px, weight, share;  // share: of what locate_edges sees there
  Channels by_exponent_px;            // d(offset)/d(exponent)
  int channels;                       // that show it

  SeenBoundary(const StepColumns& columns, double of_radial_px)
      : boundary(columns.edge.boundary), radial_px(of_radial_px) {
    const ChannelSteps steps = channel_steps(columns, std::identity());
    const Channels of_most = steps.step.abs() / steps.step.abs().maxCoeff();
    const Eigen::Array<bool, 3, 1> shown =
        of_most > believed.least_step && steps.offset_px.abs() < believed.farthest_px;
    const Channels variance_px2 = (believed.sigma_px / of_most).square() + steps.gloss_px.square();
    weight = shown.select(variance_px2.inverse(), 0);
    offset_px = shown.select(steps.offset_px, 0);
    const auto raised = [](float light) { return std::pow(light, 1 + believed.exponent_step); };
    const Channels there_px = channel_steps(columns, raised).offset_px;
    by_exponent_px = (weight > 0).select((there_px - offset_px) / believed.exponent_step, 0);
    share = of_most.square() / of_most.square().sum();
    channels = static_cast<int>(shown.count());
  }
  // A pattern of offsets less its mean.
  Channels apart(const Channels& pattern) const { return pattern - (weight * pattern).sum() / weight.sum(); }
};
using SeenBoundaries = InplaceVector<SeenBoundary, 4>;

struct Disagreement {
  double squares = 0;  // of channels about each boundary's mean, in squared sigmas
  int degrees = 0;

  explicit Disagreement(const SeenBoundaries& seen) {
    for (const SeenBoundary& boundary : seen) {
      squares += (boundary.weight * boundary.apart(boundary.offset_px).square()).sum();
      degrees += boundary.channels - 1;
    }
  }
  bool is_plain() const { return degrees >= believed.least_degrees && squares > believed.least_squares; }
};

// The part of the offsets that a few numbers explain.
template <int Numbers>
struct Explanation {
  Eigen::Matrix<double, Numbers, 1> found, sigma;
  double scatter = 0;  // of what is left a degree, in squared sigmas
  double gain = 0;     // of a number, by the scatter
};

// `pattern(boundary, number)`: the offsets by one of it; `usual`: one sigma of it before the frame is seen;
// `told_of_scatter`: what part of the scatter its sigma takes in.
template <int Numbers, typename Pattern>
Explanation<Numbers> explained(const SeenBoundaries& seen, const Disagreement& all, double usual,
                               double told_of_scatter, const Pattern& pattern) {
  using Square = Eigen::Matrix<double, Numbers, Numbers>;
  Square information = Square::Identity() / (usual * usual);
  Eigen::Matrix<double, Numbers, 1> gradient = decltype(gradient)::Zero();
  for (const SeenBoundary& boundary : seen)
    for (int i = 0; i < Numbers; ++i) {
      const Channels apart = boundary.weight * boundary.apart(pattern(boundary, i));
      for (int j = 0; j < Numbers; ++j) information(i, j) += (apart * pattern(boundary, j)).sum();
      gradient[i] += (apart * boundary.offset_px).sum();
    }
  const Square covariance = information.inverse();
  Explanation<Numbers> out;
  out.found = covariance * gradient;
  const double of_all = out.found.dot(gradient);
  out.scatter = (all.squares - of_all) / (all.degrees - Numbers);
  const double told_scatter = std::max(out.scatter, believed.least_scatter);
  out.sigma = (told_of_scatter * told_scatter * covariance.diagonal()).cwiseSqrt();
  out.gain = of_all / Numbers / told_scatter;
  return out;
}

Channels by_aberration_px(const SeenBoundary& boundary, int number) {
  return boundary.radial_px * Eigen::Vector3d::Unit(number == 0 ? 0 : 2).array();
}

template <typename DoubtOf>
std::array<double, 4> of_each_boundary(const SeenBoundaries& seen, const DoubtOf& doubt_of) {
  std::array<std::optional<double>, 4> doubts;
  for (const SeenBoundary& boundary : seen) doubts[boundary.boundary] = doubt_of(boundary);
  return magnitudes_px(doubts);
}

CameraDeparture by_aberration(const SeenBoundaries& seen, const Explanation<2>& explanation) {
  CameraDeparture out;
  out.aberration = {1 + explanation.found[0], 1 + explanation.found[1]};
  out.sigma_aberration = {explanation.sigma[0], explanation.sigma[1]};
  out.doubt_of_radial = of_each_boundary(seen, [&](const SeenBoundary& boundary) {
    return std::hypot(explanation.sigma[0] * boundary.share[0], explanation.sigma[1] * boundary.share[2]);
  });
  return out;
}

CameraDeparture by_exponent(const SeenBoundaries& seen, const Explanation<1>& explanation) {
  CameraDeparture out;
  // The offsets are what an exponent of less than 1 left: they vanish with the opposite.
  out.exponent = 1 - explanation.found[0];
  out.sigma_exponent = std::hypot(explanation.sigma[0], believed.doubted_of_response * explanation.found[0]);
  out.doubt_of_response_px = of_each_boundary(seen, [&](const SeenBoundary& boundary) {
    return out.sigma_exponent * (boundary.share * boundary.by_exponent_px).sum();
  });
  return out;
}

// `edges`: in light.
SeenBoundaries seen_in(const ChannelGeometry& channels, const PooledEdges& edges, double blur_px) {
  SeenBoundaries seen;
  for (const PooledEdge& edge : edges.all) {
    if (!edge.is_seen()) continue;
    const double radial_px = static_cast<double>((edge.place_px - channels.centre()).dot(edge.normal));
    const SeenBoundary boundary(StepColumns(edge, static_cast<float>(blur_px)), radial_px);
    if (boundary.channels > 1) seen.push_back(boundary);
  }
  return seen;
}

Explanation<1> explained_by_response(const SeenBoundaries& seen, const Disagreement& all) {
  return explained<1>(seen, all, believed.usual_exponent, believed.told_of_response_scatter,
                      [](const SeenBoundary& boundary, int) { return boundary.by_exponent_px; });
}

// Specular light beside one boundary looks like another response there; a camera's shows without any one of them.
bool is_at_more_than_one(const SeenBoundaries& seen, const Disagreement& all, double exponent) {
  return std::ranges::all_of(seen, [&](const SeenBoundary& left_out) {
    SeenBoundaries others;
    for (const SeenBoundary& boundary : seen)
      if (&boundary != &left_out) others.push_back(boundary);
    return explained_by_response(others, all).found[0] / exponent > believed.least_of_others;
  });
}

}  // namespace

std::optional<CameraDeparture> CameraDeparture::then(const CameraDeparture& more) const {
  CameraDeparture out = *this;
  if (more.aberration != ChromaticAberration{} || more.sigma_aberration != ChromaticAberration{0, 0}) {
    out.aberration.blue *= more.aberration.blue, out.aberration.red *= more.aberration.red;
    out.sigma_aberration = more.sigma_aberration, out.doubt_of_radial = more.doubt_of_radial;
  }
  if (more.exponent != 1) {
    out.exponent *= more.exponent;
    out.sigma_exponent = more.sigma_exponent, out.doubt_of_response_px = more.doubt_of_response_px;
  }
  // So near to the rig's response nothing would have been accepted.
  if (std::abs(out.exponent - 1) < believed.least_exponent)
    out.exponent = 1, out.sigma_exponent = 0, out.doubt_of_response_px = {};
  const double magnified = std::max(std::abs(out.aberration.blue - 1), std::abs(out.aberration.red - 1));
  if (magnified > believed.most_aberration || std::abs(out.exponent - 1) > believed.most_exponent) return std::nullopt;
  return out;
}

DepartedLight::DepartedLight(const LightImage& light, const CameraDeparture& departure) : light_(light) {
  ChannelGeometry channels = light.channels();
  if (departure.aberration != ChromaticAberration{}) channels.magnify(departure.aberration);
  const bool is_raised = departure.exponent != 1;
  for (std::size_t i = 0; is_raised && i < light_of_value_.size(); ++i)
    light_of_value_[i] = std::pow(light.light_of_value()[i], static_cast<float>(departure.exponent));
  light_ = LightImage(light.image(), is_raised ? light_of_value_ : light.light_of_value(), channels);
}

std::optional<CameraDeparture> find_departure(const LightImage& light, std::span<const Measurement> measurements,
                                              double blur_px) {
  const ChannelGeometry& channels = light.channels();
  if (!(channels.corner_px > 0)) return std::nullopt;  // of a frame whose middle nobody gave
  PooledEdges glance = pool_edges(light, measurements, Look::glance);
  for (PooledEdge& edge : glance.all)
    for (auto& channel : edge.value)
      for (float& value : channel) value = light_at(light.light_of_value(), value).y;
  if (!Disagreement(seen_in(channels, glance, blur_px)).is_plain()) return std::nullopt;
  // Means of values have dark edges, which look like another response.
  const PooledEdges edges = pool_edges(light, measurements, Look::light);
  const SeenBoundaries seen = seen_in(channels, edges, blur_px);
  const Disagreement all(seen);
  if (!all.is_plain()) return std::nullopt;
  auto aberration = explained<2>(seen, all, believed.usual_aberration, believed.told_of_scatter, by_aberration_px);
  const auto response = explained_by_response(seen, all);
  if (response.scatter < std::min(aberration.scatter, believed.most_response_scatter) &&
      response.gain > believed.least_response_gain && std::abs(response.found[0]) > believed.least_exponent &&
      is_at_more_than_one(seen, all, response.found[0]))
    return by_exponent(seen, response);
  if (aberration.gain > believed.least_gain) return by_aberration(seen, aberration);
  if (!(aberration.gain > believed.least_doubted_gain && aberration.scatter < believed.most_doubted_scatter))
    return std::nullopt;
  // It may be specular light or shading as well.
  aberration.sigma = aberration.sigma.cwiseMax(aberration.found.cwiseAbs());
  aberration.found.setZero();
  return by_aberration(seen, aberration);
}

std::array<double, 4> moved_by_exponent_px(const LightImage& light, std::span<const Measurement> measurements,
                                           double blur_px) {
  const PooledEdges edges = pool_edges(light, measurements, Look::light);
  std::array<double, 4> moved_px{};
  for (const SeenBoundary& seen : seen_in(light.channels(), edges, blur_px))
    moved_px[seen.boundary] = (seen.share * seen.by_exponent_px).sum();
  return moved_px;
}

}  // namespace lapservo::internal
