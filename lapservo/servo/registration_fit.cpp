#include "lapservo/servo/registration_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/dense_matrix.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {
namespace {

// Rotation about the RCM frame's axes, translation, offsets of phi, rho, psi, delay, backlash of rho, psi.
constexpr int size = 12;
using Numbers = Eigen::Matrix<double, size, 1>;
using Edges = Eigen::Matrix<double, 8, 1>;
using Slopes = Eigen::Matrix<double, 8, size>;
using Normal = Eigen::Matrix<double, size, size>;

// Noise of an edge's image, and what counts as an outlier: multiples of it.
constexpr double sigma_px = 0.1, loss_sigmas = 10;

// Behind gaps of some width, and how its rho and psi change with the widths.
struct CrossedSighting : MarkerSighting {
  Eigen::Vector2d per_width = Eigen::Vector2d::Zero();
};

// A width below 0 is an instrument that leads as one above 0 lets it lag: derivatives go through 0.
std::vector<double> shifts(const GapPath& path, Eigen::Index joint, double width) {
  const double gap_width = std::abs(width);
  const int side = path.sides[joint];
  Backlash gap(path.joints.front()[joint], side);
  std::vector<double> result;
  for (const Eigen::Vector2d& at : path.joints) {
    gap.follow(at[joint], gap_width);
    result.push_back(std::copysign(1, width) * (gap.instrument(gap_width) - at[joint] + side * gap_width / 2));
  }
  return result;
}

std::vector<CrossedSighting> cross(const std::vector<MarkerSighting>& sightings, const GapPath& path,
                                   const Eigen::Vector2d& widths) {
  const Eigen::Vector2d step(1e-6, 1e-4);
  std::vector<CrossedSighting> crossed;
  for (const MarkerSighting& sighting : sightings) crossed.push_back({sighting});
  for (Eigen::Index k = 0; k < 2; ++k) {
    const auto now = shifts(path, k, widths[k]), more = shifts(path, k, widths[k] + step[k]),
               less = shifts(path, k, widths[k] - step[k]);
    for (CrossedSighting& sighting : crossed) {
      const std::size_t i = sighting.path_index;
      sighting.per_width[k] = (more.at(i) - less.at(i)) / (2 * step[k]);
      sighting.q[2 + k] += now.at(i) - sighting.per_width[k] * widths[k];
    }
  }
  return crossed;
}

struct Model {
  const Camera& camera;
  const Marker& marker;
  Rigid3 start;

  Rigid3 camera_from_rcm(const Numbers& x) const {
    return {(start.rotation * rotation_by(x.head<3>())).normalized(), start.translation + x.segment<3>(3)};
  }
  std::optional<Edges> edges_px(const CrossedSighting& sighting, const Numbers& x) const {
    Eigen::Vector4d q = sighting.q - x[9] * sighting.q_rate;
    q.tail<3>() += x.segment<3>(6);
    q.tail<2>() += sighting.per_width.cwiseProduct(x.tail<2>());
    const Rigid3 unrolled = camera_from_rcm(x) * rcm_from_unrolled(JointVector::from_vector(q));
    const auto line = centre_line(camera, marker, unrolled, q[3]);
    if (!line) return std::nullopt;
    Edges edges;
    for (Eigen::Index k = 0; k < 4; ++k) edges.segment<2>(2 * k) = line->ideal_px[static_cast<std::size_t>(k)];
    return edges;
  }
};

Numbers steps() {
  Numbers step = Numbers::Constant(1e-5);
  step.segment<3>(3).setConstant(1e-6);
  step[7] = step[10] = 1e-6, step[9] = 1e-4;
  return step;
}

struct Sums {
  Normal information = Normal::Zero();
  Numbers gradient = Numbers::Zero();
  double cost = 0, squares_px2 = 0;
  double newest_px2 = 0;  // of the last one
};

double loss(double squares) {
  return loss_sigmas * loss_sigmas * std::log1p(squares / (loss_sigmas * loss_sigmas));
}

double rms_px(double squares_px2, std::size_t sightings) {
  return std::sqrt(squares_px2 / (8.0 * static_cast<double>(sightings)));
}

bool add(const Model& model, const CrossedSighting& sighting, const Numbers& x, bool with_slopes, Sums& sums) {
  const auto expected = model.edges_px(sighting, x);
  if (!expected) return false;
  const Edges off = (*expected - sighting.edges_px) / sigma_px;
  sums.cost += loss(off.squaredNorm());
  sums.newest_px2 = sigma_px * sigma_px * off.squaredNorm();
  sums.squares_px2 += sums.newest_px2;
  if (!with_slopes) return true;
  static const Numbers step = steps();
  Slopes slopes;
  for (Eigen::Index i = 0; i < size; ++i) {
    const Numbers by = step[i] * Numbers::Unit(i);
    const auto more = model.edges_px(sighting, x + by), less = model.edges_px(sighting, x - by);
    if (!more || !less) return false;
    slopes.col(i) = (*more - *less) / (2 * step[i] * sigma_px);
  }
  const double trust = 1 / (1 + off.squaredNorm() / (loss_sigmas * loss_sigmas));
  sums.information += trust * slopes.transpose() * slopes;
  sums.gradient += trust * slopes.transpose() * off;
  return true;
}

std::optional<Sums> sum(const Model& model, const std::vector<MarkerSighting>& sightings, const GapPath& path,
                        const Numbers& x, const Numbers& prior_weights, bool with_slopes) {
  Sums sums;
  for (const CrossedSighting& sighting : cross(sightings, path, x.tail<2>()))
    if (!add(model, sighting, x, with_slopes, sums)) return std::nullopt;
  sums.cost += x.dot(prior_weights.cwiseProduct(x));
  sums.information.diagonal() += prior_weights;
  sums.gradient += prior_weights.cwiseProduct(x);
  if (!std::isfinite(sums.cost)) return std::nullopt;
  return sums;
}

// Errors that all images share (film, lens, print) do not average out: so many images count as one.
constexpr double alike_images = 20;

Numbers weights_of(const RegistrationPrior& prior) {
  Numbers weights = Numbers::Zero();
  weights.tail<6>() << prior.phi_rad, prior.rho_m, prior.psi_rad, prior.delay_s, prior.rho_backlash_m,
      prior.psi_backlash_rad;
  weights.tail<6>() = weights.tail<6>().cwiseAbs2().cwiseInverse().eval();
  return weights;
}

}  // namespace

Rigid3 camera_from_rcm_by(const Marker& marker, const MarkerSighting& sighting) {
  const auto q = JointVector::from_vector(sighting.q);
  return sighting.camera_from_marker * camera_from_marker(marker, rcm_from_unrolled(q), q.psi_rad).inverse();
}

// Levenberg and Marquardt's.
std::optional<RegistrationFit> fit_registration(const Camera& camera, const Marker& marker,
                                                const std::vector<MarkerSighting>& sightings, const GapPath& path,
                                                const Rigid3& start, const RegistrationPrior& prior) {
  constexpr int max_iterations = 40;
  const Model model{camera, marker, start};
  const Numbers weights = weights_of(prior);
  Numbers x = Numbers::Zero();
  double damping = 1e-4;
  if (sightings.empty()) return std::nullopt;
  auto at = sum(model, sightings, path, x, weights, true);
  if (!at) return std::nullopt;
  for (int i = 0; i < max_iterations && damping < 1e8; ++i) {
    Normal damped = at->information;
    damped.diagonal() *= 1 + damping;
    const Numbers step = -solve_symmetric(damped, at->gradient);
    const auto there = sum(model, sightings, path, x + step, weights, false);
    if (!there || !(there->cost < at->cost)) {
      damping *= 10;
      continue;
    }
    const bool settled = at->cost - there->cost < 1e-9 * at->cost;
    x += step;
    damping = std::max(1e-10, damping / 10);
    at = sum(model, sightings, path, x, weights, true);
    if (!at) return std::nullopt;
    if (settled) break;
  }
  RegistrationFit fit;
  fit.camera_from_rcm = model.camera_from_rcm(x);
  fit.rms_px = rms_px(at->squares_px2, sightings.size());
  fit.newest_rms_px = rms_px(at->newest_px2, 1);
  const double worse = std::max(1.0, fit.rms_px / sigma_px);
  const Normal covariance = alike_images * worse * worse * inverse_of_symmetric(at->information);
  fit.covariance = in_camera_axes(fit.camera_from_rcm, covariance.topLeftCorner<6, 6>());
  fit.sigma_rotation_rad = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  fit.sigma_position_m = std::sqrt(covariance.block<3, 3>(3, 3).trace());
  if (!std::isfinite(fit.sigma_rotation_rad) || !std::isfinite(fit.sigma_position_m)) return std::nullopt;
  return fit;
}

}  // namespace lapservo::internal
