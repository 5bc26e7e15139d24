#include "lapservo/calibration/response_fit.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <numeric>
#include <tuple>
#include <type_traits>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "lapservo/calibration/solve_quietly.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/median.h"
#include "lapservo/core/rounded_sigma.h"

namespace lapservo::internal {
namespace {

// The response is value = s + sum of c_k B_k(s), s the light as sRGB encodes it, B_k cubic B-splines over equal parts
// of [0, 1] without those that move the ends.
constexpr int parts = 8, curve_numbers = parts + 1;
// All edges share: c_k; the logarithm of dark over bright reflectance; sharpening's strength and log blur.
constexpr int ratio = curve_numbers, strength = ratio + 1, common_numbers = strength + 2;
// Those at like angles to the rows of pixels: how blurred edges differ from a normal distribution's at so many steps on
// either side. What filters on pixels make of a lens' blur is symmetric and no more.
constexpr int shape_numbers = 8;
constexpr std::array shape_angles_rad{rad_from_deg(6), rad_from_deg(12), rad_from_deg(24), rad_from_deg(46)};
// Of an edge: logarithm of its bright light, of dark over bright beyond the common one, of its blur in pixels; its
// offset.
constexpr int edge_numbers = 4;

constexpr double max_sharpening_reach_px = 7;
// Before the fit, one sigma: reflectances at different places of the board (gloss, veil), edges about the geometry's,
// the curve beyond what others are like.
constexpr double ratio_sigma = 0.03, offset_sigma_px = 0.02, log_blur_sigma = 0.3;
constexpr double other_curve_sigma = 0.01, strength_sigma = 0.5, usual_mask_px = 1.5, log_mask_sigma = 0.3,
                 shape_sigma = 0.02;

double srgb_of(double light) {
  return light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}
template <typename T>
T srgb_of(const T& light) {
  if (light <= 0.0031308) return light * 12.92;
  return T(1.055) * pow(light, 1 / 2.4) - T(0.055);
}

template <typename T>
T encoded(const T* curve, const T& light) {
  const T s = srgb_of(light);
  if (s <= 0.0 || s >= 1.0) return s;
  // de Boor on the clamped knots: four splines differ from zero.
  double at;
  if constexpr (std::is_same_v<T, double>)
    at = s;
  else
    at = s.a;
  const int part = std::min(parts - 1, static_cast<int>(at * parts));
  const auto knot = [](int i) { return static_cast<double>(std::clamp(i, 0, parts)) / parts; };
  T d[4];
  for (int j = 0; j < 4; ++j) {
    const int k = part + j - 1;  // the first and the last spline of all are left out
    d[j] = k < 0 || k >= curve_numbers ? T(0) : curve[k];
  }
  for (int r = 1; r <= 3; ++r)
    for (int j = 3; j >= r; --j) {
      const double low = knot(part - 3 + j), high = knot(part + 1 + j - r);
      const T alpha = (s - low) / (high - low);
      d[j] = (T(1) - alpha) * d[j - 1] + alpha * d[j];
    }
  return s + d[3];
}

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

// What a fit takes for given.
struct Given {
  const Response* response = nullptr;  // null where the curve is free
  bool sharpened = false;
};

struct ProfileCost {
  const BoardEdgeProfile* profile;
  const Given* given;

  // The values of a profile as the numbers have them.
  template <typename T>
  std::vector<T> values(const T* shared, const T* shape, const T* edge) const {
    using std::erfc;
    using std::exp;
    const int half = static_cast<int>(profile->value.size() / 2);
    const int reach = given->sharpened ? static_cast<int>(max_sharpening_reach_px / profile_step_px) : 0;
    const T bright = exp(edge[0]), dark = exp(edge[0] + shared[ratio] + edge[1]), blur_px = exp(edge[2]);
    const auto rise = [&](const T& z) { return T(0.5) * erfc(-z / std::sqrt(2.0)); };
    std::vector<T> plain;
    for (int i = -half - reach; i <= half + reach; ++i) {
      const T z = (T(i * profile_step_px) - edge[3]) / blur_px;
      T part = rise(z);
      if (const int from = std::abs(i); from > 0 && from <= shape_numbers)
        part += static_cast<double>(i > 0 ? 1 : -1) * shape[from - 1];
      const T light = dark + (bright - dark) * part;
      plain.push_back(given->response ? encoded_by(*given->response, light) : encoded(shared, light));
    }
    if (!given->sharpened) return plain;
    const T mask_px = exp(shared[strength + 1]);
    std::vector<T> mask;
    T sum(0);
    for (int k = 0; k <= reach; ++k) {
      const T z = T(k * profile_step_px) / mask_px;
      mask.push_back(exp(T(-0.5) * z * z));
      sum += (k == 0 ? 1.0 : 2.0) * mask.back();
    }
    std::vector<T> values;
    for (int i = 0; i <= 2 * half; ++i) {
      const auto centre = static_cast<std::size_t>(i + reach);
      T smooth = mask[0] * plain[centre];
      for (std::size_t k = 1; k < mask.size(); ++k) smooth += mask[k] * (plain[centre - k] + plain[centre + k]);
      values.push_back(plain[centre] + shared[strength] * (plain[centre] - smooth / sum));
    }
    return values;
  }
  template <typename T>
  bool operator()(const T* shared, const T* shape, const T* edge, T* residuals) const {
    const std::vector<T> expected = values(shared, shape, edge);
    for (std::size_t i = 0; i < expected.size(); ++i)
      residuals[i] = std::isnan(profile->value[i]) ? T(0) : (expected[i] - profile->value[i]) / profile->sigma[i];
    residuals[expected.size()] = edge[1] / ratio_sigma;
    residuals[expected.size() + 1] = edge[3] / offset_sigma_px;
    residuals[expected.size() + 2] = (edge[2] - std::log(profile->blur_px)) / log_blur_sigma;
    return true;
  }
};

using Curve = Eigen::Matrix<double, curve_numbers, 1>;
using CurveMatrix = Eigen::Matrix<double, curve_numbers, curve_numbers>;

// The curve of which value = value_of(s) comes nearest.
Curve curve_of(const std::function<double(double)>& value_of) {
  constexpr int places = 64;
  Eigen::Matrix<double, places, curve_numbers> splines;
  Eigen::Matrix<double, places, 1> beyond;
  for (int i = 0; i < places; ++i) {
    const double s = (i + 0.5) / places, light = Response{}.light_from_value(s);
    beyond[i] = value_of(s) - s;
    for (int k = 0; k < curve_numbers; ++k) {
      std::array<double, curve_numbers> unit{};
      unit[static_cast<std::size_t>(k)] = 1;
      splines(i, k) = encoded(unit.data(), light) - s;
    }
  }
  const Eigen::MatrixXd across = splines.transpose();
  return solve_symmetric(product(across, splines), product(across, beyond));
}

// What cameras' curves are like, where the pictures leave it open: standard ones, with contrast (a logistic curve about
// a middle) and shoulders of several strengths; and what differs from all of these.
struct CurvePrior {
  Curve mean = Curve::Zero();
  CurveMatrix whitening;

  CurvePrior() {
    std::vector<Curve> family;
    for (const Response& base : {Response{}, Response{Response::Kind::rec709}, Response{Response::Kind::power, 1.9},
                                 Response{Response::Kind::power, 2.2}})
      for (const double contrast : {0.1, 2.0, 4.0, 6.0})
        for (const double middle : {0.35, 0.45, 0.55})
          for (const double shoulder : {0.0, 0.3, 0.6}) family.push_back(member(base, contrast, middle, shoulder));
    for (const Curve& curve : family) mean += curve / static_cast<double>(family.size());
    CurveMatrix covariance = CurveMatrix::Identity() * other_curve_sigma * other_curve_sigma;
    for (const Curve& curve : family)
      covariance += (curve - mean) * (curve - mean).transpose() / static_cast<double>(family.size());
    whitening = whitening_of(covariance);
  }
  static Curve member(const Response& base, double contrast, double middle, double shoulder) {
    const auto logistic = [&](double x) { return 1 / (1 + std::exp(-contrast * (x - middle))); };
    return curve_of([&](double s) {
      const double value = base.value_from_light(Response{}.light_from_value(s));
      const double bent = (logistic(value) - logistic(0)) / (logistic(1) - logistic(0));
      return bent * (1 + shoulder) / (1 + shoulder * bent);
    });
  }

  template <typename T>
  bool operator()(const T* shared, T* residuals) const {
    for (int i = 0; i < curve_numbers; ++i) {
      residuals[i] = T(0);
      for (int k = i; k < curve_numbers; ++k) residuals[i] += whitening(i, k) * (shared[k] - mean[k]);
    }
    residuals[curve_numbers] = shared[strength] / strength_sigma;
    residuals[curve_numbers + 1] = (shared[strength + 1] - std::log(usual_mask_px)) / log_mask_sigma;
    return true;
  }
  static constexpr int size = curve_numbers + 2;
};

struct ShapePrior {
  template <typename T>
  bool operator()(const T* shape, T* residuals) const {
    for (int i = 0; i < shape_numbers; ++i) residuals[i] = shape[i] / shape_sigma;
    return true;
  }
};

using Shared = std::array<double, common_numbers>;
using Shape = std::array<double, shape_numbers>;

std::size_t shape_of(const BoardEdgeProfile& profile) {
  std::size_t i = 0;
  while (i + 1 < shape_angles_rad.size() && profile.angle_rad > shape_angles_rad[i]) ++i;
  return i;
}

// The curve as a table, even in what sRGB makes of light: fine in the dark.
Response table_of(const Shared& shared) {
  constexpr int steps = 64;
  Response table{Response::Kind::table, 1, {0}, {0}};
  const Response srgb;
  for (int i = 1; i <= steps; ++i) {
    const double light = i == steps ? 1 : srgb.light_from_value(static_cast<double>(i) / steps);
    const double value = i == steps ? 1 : encoded(shared.data(), light);
    // Noise may bend it back where it is nearly flat.
    table.table_light.push_back(light);
    table.table_value.push_back(std::max(value, table.table_value.back() + 1e-5));
  }
  table.table_value.back() = 1;  // where those before it went beyond
  for (int i = steps - 1; i > 0 && table.table_value[static_cast<std::size_t>(i)] >= 1 - 1e-5 * (steps - i); --i)
    table.table_value[static_cast<std::size_t>(i)] = 1 - 1e-5 * (steps - i);
  return table;
}

Shared start_of(const Response& response) {
  const Curve curve = curve_of([&](double s) { return response.value_from_light(Response{}.light_from_value(s)); });
  Shared shared{};
  std::copy(curve.begin(), curve.end(), shared.begin());
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
};

std::vector<Named> named_responses() {
  std::vector<Named> all{{"srgb", {}}, {"rec709", {Response::Kind::rec709}}, {"linear", {Response::Kind::power, 1}}};
  for (const double gamma : {1.8, 2.0, 2.2, 2.4})
    all.push_back({fmt::format("gamma:{}", gamma), {Response::Kind::power, gamma}});
  return all;
}

double curve_sigma_of(ceres::Problem& problem, const Shared& shared, double scale, double low, double high) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  if (!covariance.Compute(std::vector<std::pair<const double*, const double*>>{{shared.data(), shared.data()}},
                          &problem))
    return std::numeric_limits<double>::infinity();
  Eigen::Matrix<double, common_numbers, common_numbers, Eigen::RowMajor> c;
  covariance.GetCovarianceBlock(shared.data(), shared.data(), c.data());
  // The curve's values at some lights, less what another exposure would be.
  constexpr int places = 41;
  Eigen::Matrix<double, places, curve_numbers> rows;
  Eigen::Matrix<double, places, 1> by_exposure;
  for (int i = 0; i < places; ++i) {
    const double s = low + (high - low) * i / (places - 1), light = Response{}.light_from_value(s);
    for (int k = 0; k < curve_numbers; ++k) {
      std::array<double, curve_numbers> unit{};
      unit[static_cast<std::size_t>(k)] = 1;
      rows(i, k) = encoded(unit.data(), light) - srgb_of(light);
    }
    constexpr double step = 1e-3;
    by_exposure[i] = encoded(shared.data(), light * (1 + step)) - encoded(shared.data(), light);
  }
  rows -= by_exposure * (by_exposure.transpose() * rows) / by_exposure.squaredNorm();
  const double most = (rows * c.topLeftCorner<curve_numbers, curve_numbers>() * rows.transpose()).diagonal().maxCoeff();
  return scale * std::sqrt(most);
}

// Sums over the pixels of a part of a profile.
struct Bin {
  int count = 0;
  double distance = 0, light = 0, value = 0, squares = 0;

  void add(double at, double pixel_light, double pixel_value) {
    ++count, distance += at, light += pixel_light, value += pixel_value, squares += pixel_value * pixel_value;
  }
  void add(const Bin& other) {
    count += other.count, distance += other.distance, light += other.light, value += other.value,
        squares += other.squares;
  }
  double variance() const { return std::max(0.0, squares / count - value / count * value / count); }
};
// A named response is tried where values differ by less, and taken where the cost is no more times that of the fit.
constexpr double max_named_distance = 0.04, named_cost = 1.03;
// Sharpening is looked for where profiles miss by more sigmas without.
constexpr double max_plain_misfit = 1.1;
constexpr double least_strength = 0.15;           // of sharpening: less is a detail of the blur
constexpr double least_variance = 0.002 * 0.002;  // rounding to 8 bits, and more

// Profiles, what explains them, and the problem that holds both together.
class ProfileFit {
 public:
  ProfileFit(const std::vector<BoardEdgeProfile>& profiles, const Response& start)
      : profiles_(profiles), shared_(start_of(start)) {
    const Response from = table_of(shared_);
    std::vector<double> ratios;
    for (const BoardEdgeProfile& p : profiles_) {
      const double bright = from.light_from_value(std::min(1.0, p.bright));
      ratios.push_back(std::log(std::max(1e-4, from.light_from_value(std::max(0.0, p.dark))) / bright));
      edges_.push_back({std::log(bright), 0, std::log(p.blur_px), 0});
    }
    shared_[ratio] = median(ratios);
    shared_[strength] = 0.1, shared_[strength + 1] = std::log(usual_mask_px);
    add_costs();
    solver_.linear_solver_type = ceres::SPARSE_SCHUR;
    solver_.max_num_iterations = 40;
    solver_.function_tolerance = 1e-6;
    solver_.num_threads = 1;  // the same to the last bit, every time
  }

  /// Of values over their sigmas.
  double misfit() const {
    double squares = 0;
    int count = 0;
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      const BoardEdgeProfile& profile = profiles_[i];
      const auto values =
          ProfileCost{&profile, &given_}.values(shared_.data(), shapes_[shape_of(profile)].data(), edges_[i].data());
      for (std::size_t k = 0; k < values.size(); ++k)
        if (std::isfinite(profile.value[k]))
          squares += std::pow((values[k] - profile.value[k]) / profile.sigma[k], 2), ++count;
    }
    return std::sqrt(squares / count);
  }

  /// Curve, and sharpening where profiles can't be understood without. False when it does not settle.
  bool solve() {
    const auto start = std::tuple(shared_, shapes_, edges_);
    if (!solve_for(false)) return false;
    if (misfit() <= max_plain_misfit) return true;
    std::tie(shared_, shapes_, edges_) = start;  // without sharpening it went astray
    return solve_for(true) && (shared_[strength] >= least_strength || solve_for(false));
  }

  /// The cost with a known response; what was fitted stays.
  std::optional<double> cost_with(const Response& response) {
    const auto fitted = std::tuple(shared_, shapes_, edges_);
    std::vector<int> fixed(curve_numbers);
    std::iota(fixed.begin(), fixed.end(), 0);
    if (!given_.sharpened) fixed.insert(fixed.end(), {strength, strength + 1});
    given_.response = &response;
    solver_.max_num_iterations = 10;
    const bool usable = run(fixed);
    const double cost = summary_.final_cost;
    std::tie(shared_, shapes_, edges_) = fitted;
    given_.response = nullptr;
    return usable ? std::optional(cost) : std::nullopt;
  }

  double cost() const { return summary_.final_cost; }
  const Shared& shared() const { return shared_; }
  bool sharpened() const { return given_.sharpened; }
  ceres::Problem& problem() { return problem_; }

 private:
  void add_costs() {
    for (std::size_t i = 0; i < profiles_.size(); ++i) {
      auto* cost =
          new ceres::AutoDiffCostFunction<ProfileCost, ceres::DYNAMIC, common_numbers, shape_numbers, edge_numbers>(
              new ProfileCost{&profiles_[i], &given_}, static_cast<int>(profiles_[i].value.size()) + 3);
      problem_.AddResidualBlock(cost, nullptr, shared_.data(), shapes_[shape_of(profiles_[i])].data(),
                                edges_[i].data());
    }
    problem_.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CurvePrior, CurvePrior::size, common_numbers>(new CurvePrior), nullptr,
        shared_.data());
    for (Shape& shape : shapes_)
      problem_.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ShapePrior, shape_numbers, shape_numbers>(new ShapePrior), nullptr,
          shape.data());
    problem_.SetParameterLowerBound(shared_.data(), strength, 0);
    problem_.SetParameterLowerBound(shared_.data(), strength + 1, std::log(1.0));
    problem_.SetParameterUpperBound(shared_.data(), strength + 1, std::log(3.0));
  }
  bool solve_for(bool sharpened) {
    given_.sharpened = sharpened;
    return run(sharpened ? std::vector<int>{} : std::vector<int>{strength, strength + 1});
  }
  bool run(const std::vector<int>& fixed) {
    problem_.SetManifold(shared_.data(), fixed.empty() ? nullptr : new ceres::SubsetManifold(common_numbers, fixed));
    return solve_quietly(solver_, problem_, summary_);
  }

  const std::vector<BoardEdgeProfile>& profiles_;
  Shared shared_;
  std::array<Shape, shape_angles_rad.size()> shapes_{};
  std::vector<std::array<double, edge_numbers>> edges_;
  Given given_;
  ceres::Problem problem_;
  ceres::Solver::Options solver_;
  ceres::Solver::Summary summary_;
};

// The value below which so many of all lie.
double quantile(std::vector<double> values, double fraction) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(fraction * static_cast<double>(values.size() - 1))];
}

// As other measured numbers are, but to digits by which the values still rise.
Response rounded_by_sigma(Response table, double sigma) {
  constexpr double of_six_decimals = 0.01;
  for (double& value : table.table_value) value = internal::rounded_by_sigma(value, std::min(sigma, of_six_decimals));
  return table;
}

// A named response that explains the profiles nearly as well is what the camera has.
void name_response(ProfileFit& profiles, ResponseFit& fit) {
  const double fitted_cost = profiles.cost();
  double best_cost = std::numeric_limits<double>::max();
  for (const auto& [name, response] : named_responses()) {
    const double distance = difference(fit.table, response, fit.low, fit.high);
    if (distance > max_named_distance) continue;
    const auto cost = profiles.cost_with(response);
    if (!cost || *cost >= best_cost) continue;
    best_cost = *cost, fit.nearest = name, fit.named_distance = distance;
    if (best_cost < named_cost * fitted_cost) fit.response = response;
  }
}

}  // namespace

std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, int towards_bright, int channel, double blur_px,
                                           const Response& response) {
  const std::array<float, 256> light = response.table();
  const auto c = static_cast<std::size_t>(channel);
  const int half = static_cast<int>(edge.reach_px / profile_step_px);
  const auto size = static_cast<std::size_t>(2 * half + 1);
  std::vector<Bin> bins(size);
  for (const EdgePixel& pixel : edge.pixels) {
    if (pixel.value[c] >= 252) return std::nullopt;
    const double towards = towards_bright * pixel.distance_px / profile_step_px;
    const long bin = std::lround(towards);
    if (std::abs(bin) > half) continue;
    bins[static_cast<std::size_t>(bin + half)].add(towards - static_cast<double>(bin), light[pixel.value[c]],
                                                   pixel.value[c] / 255.0);
  }
  BoardEdgeProfile profile;
  profile.blur_px = blur_px;
  const Eigen::Vector2d along = edge.path.along.cwiseAbs();
  profile.angle_rad = std::atan2(along.minCoeff(), along.maxCoeff());
  constexpr int least = 4;
  std::vector<double> means(size, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = 0; i < size; ++i)
    if (bins[i].count >= least) means[i] = bins[i].light / bins[i].count;
  profile.value = means, profile.sigma.assign(size, 0);
  // A bin's pixels need not lie evenly about its middle.
  for (std::size_t i = 1; i + 1 < size; ++i) {
    const double slope = (means[i + 1] - means[i - 1]) / 2;
    if (std::isfinite(slope) && std::isfinite(means[i])) profile.value[i] -= slope * bins[i].distance / bins[i].count;
  }
  for (double& value : profile.value)
    if (std::isfinite(value)) value = response.value_from_light(std::clamp(value, 0.0, 1.0));
  Bin dark, bright;
  for (std::size_t i = 0; i < size / 5; ++i) dark.add(bins[i]), bright.add(bins[size - 1 - i]);
  if (dark.count < 3 * least || bright.count < 3 * least) return std::nullopt;
  profile.dark = response.value_from_light(dark.light / dark.count);
  profile.bright = response.value_from_light(bright.light / bright.count);
  if (profile.bright - profile.dark < 0.05) return std::nullopt;
  for (std::size_t i = 0; i < size; ++i) {
    if (!std::isfinite(profile.value[i])) continue;
    const double part = std::clamp((profile.value[i] - profile.dark) / (profile.bright - profile.dark), 0.0, 1.0);
    profile.sigma[i] =
        std::sqrt(((1 - part) * dark.variance() + part * bright.variance() + least_variance) / bins[i].count);
  }
  return profile;
}

std::optional<ResponseFit> fit_response(const std::vector<BoardEdgeProfile>& profiles, const Response& start,
                                        bool try_named) {
  constexpr std::size_t least_profiles = 50;
  if (profiles.size() < least_profiles) return std::nullopt;
  ResponseFit fit;
  ProfileFit fitted(profiles, start);
  fit.misfit[0] = fitted.misfit();
  if (!fitted.solve()) return std::nullopt;
  fit.misfit[1] = fitted.misfit();
  fit.sharpening = fitted.sharpened() ? fitted.shared()[strength] : 0;
  fit.sharpening_px = std::exp(fitted.shared()[strength + 1]);
  std::vector<double> darks, brights;
  for (const BoardEdgeProfile& p : profiles) darks.push_back(p.dark), brights.push_back(p.bright);
  fit.low = quantile(darks, 0.02), fit.high = quantile(brights, 0.98);
  fit.sigma = curve_sigma_of(fitted.problem(), fitted.shared(), std::max(1.0, fit.misfit[1]), fit.low, fit.high);
  if (!std::isfinite(fit.sigma)) return std::nullopt;
  fit.table = fit.response = rounded_by_sigma(table_of(fitted.shared()), fit.sigma);
  if (try_named) name_response(fitted, fit);
  return fit;
}

}  // namespace lapservo::internal
