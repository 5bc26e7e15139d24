#include "lapservo/servo/sighting_fit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "lapservo/core/dense_matrix.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {
namespace {

using Six = Eigen::Matrix<double, 6, 1>;
using Slopes = Eigen::Matrix<double, 6, arm::numbers>;
using Shifts = std::vector<Eigen::Vector2d>;  // of rho and psi, one per place of a path

constexpr double step = 1e-6;

// A width below 0 is an instrument that leads as one above 0 lets it lag: derivatives go through 0.
Shifts shifts_by(const GapPath& path, const Eigen::Vector2d& widths) {
  Shifts shifts(path.joints.size());
  for (Eigen::Index k = 0; k < 2 && !shifts.empty(); ++k) {
    const double width = std::abs(widths[k]);
    Backlash gap(path.joints.front()[k], path.sides[k]);
    for (std::size_t i = 0; i < shifts.size(); ++i) {
      const double at = path.joints[i][k];
      gap.follow(at, width);
      shifts[i][k] = std::copysign(1, widths[k]) * (gap.instrument(width) - at + path.sides[k] * width / 2);
    }
  }
  return shifts;
}

Eigen::Vector2d at(const Shifts& shifts, const MarkerSighting& seen) {
  return shifts.empty() ? Eigen::Vector2d(Eigen::Vector2d::Zero()) : shifts.at(seen.path_index);
}

struct Sums {
  ArmMatrix information = ArmMatrix::Zero();
  ArmNumbers gradient = ArmNumbers::Zero();
  double cost = 0, squares = 0, newest = 0;
};

class Fit {
 public:
  Fit(const ArmData& data, const ArmHypothesis& hypothesis) : data_(data), hypothesis_(hypothesis) {
    for (int i = 0; i < arm::numbers; ++i) {
      if (hypothesis.sigmas[i] > 0) free_.push_back(i);
      prior_[i] = hypothesis.sigmas[i] > 0 ? 1 / (hypothesis.sigmas[i] * hypothesis.sigmas[i]) : 1;
    }
  }

  Sums sum(const ArmNumbers& x, bool with_slopes) const {
    const Shifts shifts = shifts_by(data_.path, x.tail<2>());
    std::array<Shifts, 2> more;
    for (int k = 0; k < 2 && with_slopes; ++k)
      if (hypothesis_.sigmas[arm::gap + k] > 0)
        more[static_cast<std::size_t>(k)] = shifts_by(data_.path, x.tail<2>() + step * Eigen::Vector2d::Unit(k));
    Sums sums;
    for (std::size_t i = 0; i < data_.sightings.size(); ++i) {
      const MarkerSighting& seen = data_.sightings[i];
      const Six errors = this->errors(i, x, at(shifts, seen));
      sums.newest = errors.squaredNorm();
      sums.squares += sums.newest;
      const double scale = data_.loss_sigmas * data_.loss_sigmas;
      sums.cost += data_.weight * scale * std::log1p(sums.newest / scale);
      if (!with_slopes) continue;
      Slopes slopes = Slopes::Zero();
      for (const int k : free_) {
        const Eigen::Vector2d shift = at(k < arm::gap ? shifts : more[static_cast<std::size_t>(k - arm::gap)], seen);
        slopes.col(k) = (this->errors(i, x + step * ArmNumbers::Unit(k), shift) - errors) / step;
      }
      const double trust = data_.weight / (1 + sums.newest / scale);
      sums.information += trust * slopes.transpose() * slopes;
      sums.gradient += trust * slopes.transpose() * errors;
    }
    sums.cost += x.dot(prior_.cwiseProduct(x));
    sums.information.diagonal() += prior_;
    sums.gradient += prior_.cwiseProduct(x);
    return sums;
  }

  // That of the hypothesis: information in units of the prior's sigmas.
  double evidence(const Sums& at) const {
    const ArmNumbers root = prior_.cwiseSqrt().cwiseInverse();
    const ArmMatrix normed = root.asDiagonal() * at.information * root.asDiagonal();
    return -(at.cost + eigenvalues_of_symmetric(normed).array().log().sum()) / 2;
  }

 private:
  Six errors(std::size_t i, const ArmNumbers& x, const Eigen::Vector2d& shift) const {
    const MarkerSighting& seen = data_.sightings[i];
    Eigen::Vector4d q = seen.q - x[arm::delay] * seen.q_rate;
    if (hypothesis_.mirrored) q[*hypothesis_.mirrored] *= -1;
    q += x.segment<4>(arm::offset);
    q.tail<2>() += shift;
    const double from_s = hypothesis_.from_s, to_s = hypothesis_.to_s;
    const double part = to_s > from_s ? std::clamp((seen.time_s - from_s) / (to_s - from_s), 0.0, 1.0)
                                      : static_cast<double>(seen.time_s > from_s);
    ArmNumbers now = x;
    now.segment<6>(arm::rotation) += part * x.segment<6>(arm::change);
    const Rigid3 camera_from_rcm = moved_by(now, data_.camera_from_rcm);
    const Rigid3 expected = camera_from_marker(data_.marker, camera_from_rcm, JointVector::from_vector(q));
    return data_.whitening[i] * pose_difference(expected, seen.camera_from_marker);
  }

  const ArmData& data_;
  const ArmHypothesis& hypothesis_;
  std::vector<int> free_;
  ArmNumbers prior_;
};

}  // namespace

Eigen::Matrix<double, 6, 1> pose_difference(const Rigid3& to, const Rigid3& from) {
  Six difference;
  difference << to.translation - from.translation, rotation_vector_of(to.rotation * from.rotation.conjugate());
  return difference;
}

Rigid3 moved_by(const ArmNumbers& numbers, const Rigid3& camera_from_rcm) {
  return {(rotation_by(numbers.segment<3>(arm::rotation)) * camera_from_rcm.rotation).normalized(),
          camera_from_rcm.translation + numbers.segment<3>(arm::translation)};
}

std::optional<ArmFit> fit_arm(const ArmData& data, const ArmHypothesis& hypothesis, const ArmNumbers& start) {
  constexpr int max_iterations = 40;
  if (data.sightings.empty()) return std::nullopt;
  const Fit model(data, hypothesis);
  ArmNumbers x = start;
  Sums at = model.sum(x, true);
  double damping = 1e-4;
  for (int i = 0; i < max_iterations && damping < 1e8; ++i) {
    ArmMatrix damped = at.information;
    damped.diagonal() *= 1 + damping;
    const ArmNumbers there = x - ArmNumbers(solve_symmetric(damped, at.gradient));
    if (!(model.sum(there, false).cost < at.cost)) {
      damping *= 10;
      continue;
    }
    const double before = at.cost;
    x = there;
    damping = std::max(1e-10, damping / 10);
    at = model.sum(x, true);
    if (before - at.cost < 1e-4) break;
  }
  ArmFit fit{x, inverse_of_symmetric(at.information)};
  fit.rms = std::sqrt(at.squares / static_cast<double>(data.sightings.size()));
  fit.newest_rms = std::sqrt(at.newest);
  fit.evidence = model.evidence(at);
  if (!fit.covariance.allFinite() || !std::isfinite(fit.evidence)) return std::nullopt;
  return fit;
}

}  // namespace lapservo::internal
