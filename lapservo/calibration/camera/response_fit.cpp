#include "lapservo/calibration/camera/response_fit.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <cstddef>
#include <limits>
#include <tuple>
#include <type_traits>

#include <Eigen/Core>
#include <fmt/format.h>

#include "lapservo/calibration/camera/response_curve.h"
#include "lapservo/calibration/fit/ceres_fit.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

// Edges at like angles to the rows of pixels share the deviation of their blur from a normal distribution at so many
// steps on either side, straight between: a lens' blur after filters on pixels is symmetric and no more.
constexpr int shape_numbers = 8;
constexpr double shape_sigma = 0.02;
constexpr std::array shape_angles_rad{rad_from_deg(6), rad_from_deg(12), rad_from_deg(24), rad_from_deg(46)};
using Shape = std::array<double, shape_numbers>;

constexpr double max_sharpening_reach_px = 7;
// Before the fit, one sigma: reflectances at different places of the board (specular light, veil), edges about the
// geometry's.
constexpr double ratio_sigma = 0.03, offset_sigma_px = 0.02, log_blur_sigma = 0.3;
constexpr double strength_sigma = 0.5, usual_mask_px = 1.5, log_mask_sigma = 0.3;

// Unknowns that all edges share.
struct SharedUnknowns {
  std::array<double, curve_numbers> curve{};
  double log_ratio = 0;                                          // of dark over bright reflectance
  double strength = 0.1, log_mask_px = std::log(usual_mask_px);  // of sharpening, and its blur
};

constexpr int edge_numbers = 4;
using EdgeBlock = std::array<double, edge_numbers>;
template <typename T>
struct Edge {
  explicit Edge(const T* block)
      : log_bright(block[0]), log_ratio_beyond(block[1]), log_blur_px(block[2]), offset_px(block[3]) {}
  const T& log_bright;
  const T& log_ratio_beyond;  // of dark over bright, beyond the common one
  const T& log_blur_px;
  const T& offset_px;
};

// Value at a light, by a response that is known.
template <typename T>
T encoded_by(const Response& response, const T& light) {
  if constexpr (std::is_same_v<T, double>) {
    return light <= 0 ? 0 : response.value_from_light(light);
  } else {
    if (light.a <= 0) return T(0);
    constexpr double step = 1e-4;
    const double value = response.value_from_light(light.a);
    const double slope = (response.value_from_light(light.a * (1 + step)) - value) / (light.a * step);
    return T(value) + slope * (light - light.a);
  }
}

// The fixed inputs of a fit.
struct Given {
  const Response* response = nullptr;  // null where the curve is free
  bool sharpened = false;
};

struct ProfileCost {
  const BoardEdgeProfile* profile;
  const Given* given;

  // The values of a profile as the numbers have them.
  template <typename T>
  std::vector<T> values(const T* curve, const T& log_ratio, const T& strength, const T& log_mask_px, const T* shape,
                        const Edge<T>& edge) const {
    using std::erfc;
    using std::exp;
    const int half = static_cast<int>(profile->value.size() / 2);
    const int reach = given->sharpened ? static_cast<int>(max_sharpening_reach_px / profile_step_px) : 0;
    const T bright = exp(edge.log_bright), dark = exp(edge.log_bright + log_ratio + edge.log_ratio_beyond),
            blur_px = exp(edge.log_blur_px);
    const auto shape_at = [&](double at_px) {
      const double steps = std::min(std::abs(at_px) / profile_step_px, shape_numbers + 1.0);
      const auto below = static_cast<std::size_t>(steps);
      const auto number = [&](std::size_t k) { return k == 0 || k > shape_numbers ? T(0) : shape[k - 1]; };
      const double beyond = steps - static_cast<double>(below);
      const T deviation = (1 - beyond) * number(below) + beyond * number(below + 1);
      return at_px < 0 ? -deviation : deviation;
    };
    const auto value_at = [&](double at_px, double spread_px2) {
      const T z = (T(at_px) - edge.offset_px) / blur_px;
      const T density = T(1 / std::sqrt(two_pi)) * exp(T(-0.5) * z * z);
      const T part = T(0.5) * erfc(-z / std::sqrt(2.0)) - density * (T(0.5 * spread_px2) * z / (blur_px * blur_px)) +
                     shape_at(at_px);
      const T light = dark + (bright - dark) * part;
      return given->response ? encoded_by(*given->response, light) : value_by_curve(curve, light);
    };
    std::vector<T> plain;
    for (std::size_t i = 0; i < profile->value.size(); ++i)
      plain.push_back(value_at(profile->at_px[i], profile->spread_px2[i]));
    if (!given->sharpened) return plain;
    const T mask_px = exp(log_mask_px);
    std::vector<T> mask;
    T sum(0);
    for (int k = 0; k <= reach; ++k) {
      const T z = T(k * profile_step_px) / mask_px;
      mask.push_back(exp(T(-0.5) * z * z));
      sum += (k == 0 ? 1.0 : 2.0) * mask.back();
    }
    std::vector<T> even, smooth;
    for (int i = -half - reach; i <= half + reach; ++i) even.push_back(value_at(i * profile_step_px, 0));
    for (int i = 0; i <= 2 * half; ++i) {
      const auto centre = static_cast<std::size_t>(i + reach);
      smooth.push_back(mask[0] * even[centre]);
      for (std::size_t k = 1; k < mask.size(); ++k) smooth.back() += mask[k] * (even[centre - k] + even[centre + k]);
    }
    std::vector<T> values;
    for (std::size_t i = 0; i < plain.size(); ++i) {
      const double at = profile->at_px[i] / profile_step_px + half;
      const auto from = static_cast<std::size_t>(std::clamp(static_cast<int>(at), 0, 2 * half - 1));
      const double part = at - static_cast<double>(from);
      const T there = smooth[from] + part * (smooth[from + 1] - smooth[from]);
      values.push_back(plain[i] + strength * (plain[i] - there / sum));
    }
    return values;
  }
  template <typename T>
  bool operator()(const T* curve, const T* log_ratio, const T* strength, const T* log_mask_px, const T* shape,
                  const T* edge_block, T* residuals) const {
    const Edge<T> edge(edge_block);
    const std::vector<T> expected = values(curve, *log_ratio, *strength, *log_mask_px, shape, edge);
    for (std::size_t i = 0; i < expected.size(); ++i)
      residuals[i] = std::isnan(profile->value[i]) ? T(0) : (expected[i] - profile->value[i]) / profile->sigma[i];
    residuals[expected.size()] = edge.log_ratio_beyond / ratio_sigma;
    residuals[expected.size() + 1] = edge.offset_px / offset_sigma_px;
    residuals[expected.size() + 2] = (edge.log_blur_px - std::log(profile->blur_px)) / log_blur_sigma;
    return true;
  }
};

struct CurvePrior {
  UsualCurves usual = usual_curves();

  template <typename T>
  bool operator()(const T* curve, T* residuals) const {
    for (int i = 0; i < curve_numbers; ++i) {
      residuals[i] = T(0);
      for (int k = i; k < curve_numbers; ++k) residuals[i] += usual.whitening(i, k) * (curve[k] - usual.mean[k]);
    }
    return true;
  }
};

struct SharpeningPrior {
  template <typename T>
  bool operator()(const T* strength, const T* log_mask_px, T* residuals) const {
    residuals[0] = *strength / strength_sigma;
    residuals[1] = (*log_mask_px - std::log(usual_mask_px)) / log_mask_sigma;
    return true;
  }
};

struct ShapePrior {
  template <typename T>
  bool operator()(const T* shape, T* residuals) const {
    for (int i = 0; i < shape_numbers; ++i) residuals[i] = shape[i] / shape_sigma;
    return true;
  }
};

std::size_t shape_of(const BoardEdgeProfile& profile) {
  std::size_t i = 0;
  while (i + 1 < shape_angles_rad.size() && profile.angle_rad > shape_angles_rad[i]) ++i;
  return i;
}

ResponseCurve curve_of(const SharedUnknowns& shared) {
  return ResponseCurve::Map(shared.curve.data());
}

SharedUnknowns start_of(const Response& response) {
  SharedUnknowns shared;
  ResponseCurve::Map(shared.curve.data()) =
      nearest_curve([&](double s) { return response.value_from_light(Response{}.light_from_value(s)); });
  return shared;
}

// The largest difference of values between two responses over [low, high], after the exposure that makes it smallest.
double difference(const Response& a, const Response& b, double low, double high) {
  double best = std::numeric_limits<double>::max();
  for (int i = -200; i <= 200; ++i) {
    const double exposure = std::exp(0.001 * i);
    double most = 0;
    for (int k = 0; k <= 40; ++k) {
      const double value = low + (high - low) * k / 40;
      most = std::max(most, std::abs(b.value_from_light(std::min(1.0, exposure * a.light_from_value(value))) - value));
    }
    best = std::min(best, most);
  }
  return best;
}

struct Named {
  std::string name;
  Response response;
  double evidence;  // its logarithm, less the table's
};

using CurveCovariance = Eigen::Matrix<double, curve_numbers, curve_numbers, Eigen::RowMajor>;

// Errors that no number of edges averages out (rounding, light along an edge, the tails of its blur), of the full
// value.
constexpr double shared_sigma = 2e-4;

// The part of the profiles' information that this leaves.
double independent_part(const std::vector<BoardEdgeProfile>& profiles) {
  double information = 0;
  std::size_t steps = 0;
  for (const BoardEdgeProfile& profile : profiles) {
    steps = std::max(steps, profile.value.size());
    for (std::size_t i = 0; i < profile.value.size(); ++i)
      if (std::isfinite(profile.value[i])) information += 1 / (profile.sigma[i] * profile.sigma[i]);
  }
  return 1 / (1 + shared_sigma * shared_sigma * information / static_cast<double>(steps));
}

// The curve by its prior and by that part of the profiles' information.
struct CurvePosterior {
  ResponseCurve curve;
  CurveCovariance covariance;
  double cost = 0;  // of the curve, less what the profiles gain by it
};

// The fit's own is that by all of the information, linear about it.
std::optional<CurvePosterior> posterior_of(ceres::Problem& problem, const SharedUnknowns& shared, double part) {
  const auto fitted = covariance_of(problem, {shared.curve.data()});
  if (!fitted) return std::nullopt;
  const UsualCurves usual = usual_curves();
  const Eigen::MatrixXd prior = product(usual.whitening.transpose(), usual.whitening);
  CurvePosterior posterior;
  posterior.covariance = inverse_of_symmetric(part * inverse_of_symmetric(*fitted) + (1 - part) * prior);
  const ResponseCurve off = curve_of(shared) - usual.mean, pull = (1 - part) * (prior * off);
  const ResponseCurve back = posterior.covariance * pull;
  posterior.curve = curve_of(shared) - back;
  posterior.cost = (off.dot(prior * off) - pull.dot(back)) / 2;
  return posterior.covariance.allFinite() ? std::optional(posterior) : std::nullopt;
}

// The largest sigma of the curve's values over [low, high], without the part that another exposure explains.
double sigma_of(const CurvePosterior& posterior, double low, double high) {
  constexpr int places = 41;
  Eigen::Matrix<double, places, curve_numbers> rows;
  Eigen::Matrix<double, places, 1> by_exposure;
  for (int i = 0; i < places; ++i) {
    const double s = low + (high - low) * i / (places - 1), light = Response{}.light_from_value(s);
    rows.row(i) = splines_at(light).transpose();
    constexpr double step = 1e-3;
    const double* curve = posterior.curve.data();
    by_exposure[i] = value_by_curve(curve, light * (1 + step)) - value_by_curve(curve, light);
  }
  rows -= by_exposure * (by_exposure.transpose() * rows) / by_exposure.squaredNorm();
  return std::sqrt((rows * posterior.covariance * rows.transpose()).diagonal().maxCoeff());
}

// Odds of any named response before the profiles, a hundred to one, and what cameras of that name differ by.
constexpr double named_log_odds = 4.6, named_sigma = 1e-3;
// Sharpening is looked for where profiles miss by more sigmas without.
constexpr double max_plain_misfit = 1.1;
constexpr double least_strength = 0.15;  // of sharpening: less is a detail of the blur

// Profiles, what explains them, and the problem that holds both together.
class ProfileFit {
 public:
  ProfileFit(const std::vector<BoardEdgeProfile>& profiles, const Response& start, const AtIteration& at_iteration)
      : profiles_(profiles), at_iteration_(at_iteration), shared_(start_of(start)) {
    const Response from = table_of(curve_of(shared_));
    std::vector<double> ratios;
    for (const BoardEdgeProfile& p : profiles_) {
      const double bright = from.light_from_value(std::min(1.0, p.bright));
      ratios.push_back(std::log(std::max(1e-4, from.light_from_value(std::max(0.0, p.dark))) / bright));
      edges_.push_back({std::log(bright), 0, std::log(p.blur_px), 0});
    }
    shared_.log_ratio = median(ratios);
    add_costs();
  }

  /// Mean square of values over their sigmas.
  double misfit() const {
    double squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      const BoardEdgeProfile& profile = profiles_[i];
      const auto values = ProfileCost{&profile, &given_}.values(
          shared_.curve.data(), shared_.log_ratio, shared_.strength, shared_.log_mask_px,
          shapes_[shape_of(profile)].data(), Edge<double>(edges_[i].data()));
      for (std::size_t k = 0; k < values.size(); ++k)
        if (std::isfinite(profile.value[k]))
          squares += std::pow((values[k] - profile.value[k]) / profile.sigma[k], 2), ++count;
    }
    return std::sqrt(squares / count);
  }

  /// Curve, and sharpening where profiles can't be understood without. False when it does not settle.
  bool solve() {
    const auto start = std::tuple(shared_, shapes_, edges_);
    if (!run({nullptr, false})) return false;
    if (misfit() <= max_plain_misfit) return true;
    std::tie(shared_, shapes_, edges_) = start;  // without sharpening it went astray
    return run({nullptr, true}) && (shared_.strength >= least_strength || run({nullptr, false}));
  }

  /// The cost with a known response, without the curve's; what was fitted stays.
  std::optional<double> cost_with(const Response& response) {
    const auto fitted = std::tuple(shared_, shapes_, edges_);
    const bool usable = run({&response, given_.sharpened});
    const double cost = summary_.final_cost - curve_cost();
    std::tie(shared_, shapes_, edges_) = fitted;
    given_.response = nullptr;
    return usable ? std::optional(cost) : std::nullopt;
  }

  double cost() const { return summary_.final_cost; }
  /// The cost of the curve's prior.
  double curve_cost() const {
    ResponseCurve residuals;
    CurvePrior()(shared_.curve.data(), residuals.data());
    return residuals.squaredNorm() / 2;
  }
  const SharedUnknowns& shared() const { return shared_; }
  bool sharpened() const { return given_.sharpened; }
  ceres::Problem& problem() { return problem_; }

 private:
  void add_costs() {
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      auto* cost = new ceres::AutoDiffCostFunction<ProfileCost, ceres::DYNAMIC, curve_numbers, 1, 1, 1, shape_numbers,
                                                   edge_numbers>(new ProfileCost{&profiles_[i], &given_},
                                                                 static_cast<int>(profiles_[i].value.size()) + 3);
      problem_.AddResidualBlock(cost, nullptr, shared_.curve.data(), &shared_.log_ratio, &shared_.strength,
                                &shared_.log_mask_px, shapes_[shape_of(profiles_[i])].data(), edges_[i].data());
    }
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<CurvePrior, curve_numbers, curve_numbers>(new CurvePrior),
                              nullptr, shared_.curve.data());
    problem_.AddResidualBlock(new ceres::AutoDiffCostFunction<SharpeningPrior, 2, 1, 1>(new SharpeningPrior), nullptr,
                              &shared_.strength, &shared_.log_mask_px);
    for (Shape& shape : shapes_)
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ShapePrior, shape_numbers, shape_numbers>(new ShapePrior), nullptr,
          shape.data());
    problem_.SetParameterLowerBound(&shared_.strength, 0, 0);
    problem_.SetParameterLowerBound(&shared_.log_mask_px, 0, std::log(1.0));
    problem_.SetParameterUpperBound(&shared_.log_mask_px, 0, std::log(3.0));
  }
  // Given parameters are fixed.
  bool run(const Given& given) {
    given_ = given;
    const auto fix = [&](double* block, bool fixed) {
      if (fixed)
        problem_.SetParameterBlockConstant(block);
      else
        problem_.SetParameterBlockVariable(block);
    };
    fix(shared_.curve.data(), given_.response != nullptr);
    fix(&shared_.strength, !given_.sharpened), fix(&shared_.log_mask_px, !given_.sharpened);
    summary_ = solve_quietly({ceres::SPARSE_SCHUR, 40}, problem_, at_iteration_);
    return summary_.IsSolutionUsable();
  }

  const std::vector<BoardEdgeProfile>& profiles_;
  const AtIteration& at_iteration_;
  SharedUnknowns shared_;
  std::array<Shape, shape_angles_rad.size()> shapes_{};
  std::vector<EdgeBlock> edges_;
  Given given_;
  ceres::Problem problem_;
  ceres::Solver::Summary summary_;
};

// As other measured numbers are, but to digits by which the values still rise.
Response rounded_by_sigma(Response table, double sigma) {
  constexpr double of_six_decimals = 0.01;
  for (double& value : table.table_value) value = internal::rounded_by_sigma(value, std::min(sigma, of_six_decimals));
  return table;
}

// The volume that the curve's prior and the profiles leave, as a part of the prior's: its logarithm.
double log_volume(const CurveCovariance& covariance) {
  const CurvePrior prior;
  const Eigen::MatrixXd whitened = prior.usual.whitening * covariance * prior.usual.whitening.transpose();
  return eigenvalues_of_symmetric((whitened + whitened.transpose()) / 2).array().max(1e-12).log().sum() / 2;
}

// By Laplace's approximation. The other numbers' volumes are alike and cancel.
std::vector<Named> weigh_named(ProfileFit& profiles, const CurvePosterior& posterior, double part) {
  const double of_table =
      -part * (profiles.cost() - profiles.curve_cost()) - posterior.cost + log_volume(posterior.covariance);
  std::vector<Named> all;
  for (const auto& [name, response] : named_responses())
    if (const auto cost = profiles.cost_with(response))
      all.push_back({name, response, named_log_odds - part * *cost - of_table});
  return all;
}

// A named response unless the profiles speak against it. Sigma is that of the mixture about the chosen one.
void choose_response(ProfileFit& profiles, const CurvePosterior& posterior, double part, ResponseFit& fit) {
  const std::vector<Named> all = weigh_named(profiles, posterior, part);
  const auto best = std::ranges::max_element(all, {}, &Named::evidence);
  if (best == all.end()) return;
  const Response table = fit.response;
  fit.nearest = best->name;
  if (best->evidence > 0) fit.response = best->response;
  const double most = std::max(0.0, best->evidence);
  double sum = 0, variance = 0;
  const auto add = [&](double evidence, const Response& response, double sigma) {
    const double weight = std::exp(evidence - most);
    if (weight < 1e-9) return;
    const double distance = difference(fit.response, response, fit.low, fit.high);
    sum += weight, variance += weight * (sigma * sigma + distance * distance);
  };
  add(0, table, fit.sigma);
  for (const Named& one : all) add(one.evidence, one.response, named_sigma);
  fit.sigma = std::sqrt(variance / sum);
}

}  // namespace

std::vector<std::pair<std::string, Response>> named_responses() {
  std::vector<std::pair<std::string, Response>> all{
      {"srgb", {}}, {"rec709", {Response::Kind::rec709}}, {"linear", {Response::Kind::power, 1}}};
  for (const double gamma : {1.8, 2.0, 2.2, 2.4})
    all.push_back({fmt::format("gamma:{}", gamma), {Response::Kind::power, gamma}});
  return all;
}

std::optional<ResponseFit> fit_response(const std::vector<BoardEdgeProfile>& profiles, const Response& start,
                                        bool try_named, const AtIteration& at_iteration) {
  constexpr std::size_t least_profiles = 50;
  if (profiles.size() < least_profiles) return std::nullopt;
  ResponseFit fit;
  ProfileFit fitted(profiles, start, at_iteration);
  if (!fitted.solve()) return std::nullopt;
  fit.misfit = fitted.misfit();
  fit.sharpening = fitted.sharpened() ? fitted.shared().strength : 0;
  fit.sharpening_px = std::exp(fitted.shared().log_mask_px);
  fit.low = quantile(values_of(profiles, &BoardEdgeProfile::dark), 0.02);
  fit.high = quantile(values_of(profiles, &BoardEdgeProfile::bright), 0.98);
  const double part = independent_part(profiles) / std::pow(std::max(1.0, fit.misfit), 2);
  const auto posterior = posterior_of(fitted.problem(), fitted.shared(), part);
  if (!posterior) return std::nullopt;
  fit.sigma = sigma_of(*posterior, fit.low, fit.high);
  if (!std::isfinite(fit.sigma)) return std::nullopt;
  fit.response = rounded_by_sigma(table_of(posterior->curve), fit.sigma);
  if (try_named) choose_response(fitted, *posterior, part, fit);
  return fit;
}

}  // namespace lapservo::internal
