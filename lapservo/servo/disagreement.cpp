#include "lapservo/servo/disagreement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"

namespace lapservo::internal {
namespace {

using Cause = Explanation::Cause;
using Six = Eigen::Matrix<double, 6, 1>;

// Offsets of q, delay, camera_from_rcm's rotation and translation, and by how much these changed.
constexpr int size = 17, delay = 4, registration = 5, change = 11;
using Numbers = Eigen::Matrix<double, size, 1>;
using Normal = Eigen::Matrix<double, size, size>;

// Standard deviations (rad, m, s) of the errors of a usable rig, and of a wrong one.
const Eigen::Vector4d usual_offset(0.05, 0.05, 0.005, 0.1), wrong_offset(2, 2, 0.1, 2);
constexpr double usual_delay_s = 0.1;
constexpr double usual_rotation_rad = 0.01, usual_translation_m = 1e-3;
constexpr double wrong_rotation_rad = 0.3, wrong_translation_m = 0.03;

// Standard deviations of the marker in one image. Neighbouring images share most of it: so many images are as good as
// all.
constexpr double sigma_across_m = 5e-4, sigma_depth = 0.01;  // the latter as a part of the distance
constexpr double sigma_axis_rad = 0.01, sigma_foreshortening_rad = 0.03, sigma_roll_rad = 0.03;
constexpr double independent_images = 20;

// Odds of 20 and of 150, as logarithms; and a misfit per number that no cause in the list explains.
constexpr double plain_odds = 3, safe_odds = 5, worst_misfit = 9;

struct Hypothesis {
  Cause cause = Cause::none;
  int joint = 0;
  double from_s = 0, to_s = 0;  // of the change
};

Numbers sigmas_of(const Hypothesis& hypothesis) {
  Numbers sigmas = Numbers::Zero();
  sigmas.head<4>() = usual_offset;
  sigmas[delay] = usual_delay_s;
  const bool wrong = hypothesis.cause == Cause::registration;
  sigmas.segment<3>(registration).setConstant(wrong ? wrong_rotation_rad : usual_rotation_rad);
  sigmas.segment<3>(registration + 3).setConstant(wrong ? wrong_translation_m : usual_translation_m);
  if (hypothesis.cause == Cause::sign || hypothesis.cause == Cause::offset)
    sigmas[hypothesis.joint] = wrong_offset[hypothesis.joint];
  if (hypothesis.cause != Cause::moved) return sigmas;
  sigmas.segment<3>(change).setConstant(wrong_rotation_rad);
  sigmas.segment<3>(change + 3).setConstant(wrong_translation_m);
  return sigmas;
}

class Model {
 public:
  Model(const Instrument& instrument, const Hypothesis& hypothesis)
      : instrument_(instrument), hypothesis_(hypothesis), sigmas_(sigmas_of(hypothesis)) {}

  // In units of their standard deviations, as `x` is.
  Six errors(const JointsAndMarker& seen, const Numbers& x) const {
    const Rigid3 expected = pose(seen, sigmas_.cwiseProduct(x));
    const Eigen::Vector3d& place = seen.camera_from_marker.translation;
    const double distance_m = place.norm();
    const Eigen::Vector3d sight = place / distance_m, off = expected.translation - place;
    const Eigen::Vector3d axis = seen.camera_from_marker.rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d tilt = axis.cross(sight).normalized(), side = axis.cross(tilt);
    const Eigen::Vector3d turn = rotation_vector_of(expected.rotation * seen.camera_from_marker.rotation.conjugate());
    const Eigen::Vector3d across = sight.unitOrthogonal(), other = sight.cross(across);
    Six errors;
    errors << off.dot(across) / sigma_across_m, off.dot(other) / sigma_across_m,
        off.dot(sight) / (sigma_depth * distance_m), turn.dot(side) / sigma_axis_rad,
        turn.dot(tilt) / sigma_foreshortening_rad, turn.dot(axis) / sigma_roll_rad;
    return errors;
  }

  // The estimate by the latest image alone.
  Numbers start(const JointsAndMarker& seen) const {
    Numbers x = Numbers::Zero();
    const int i = hypothesis_.joint;
    if (sigmas_[i] != wrong_offset[i]) return x;
    const Rigid3& camera_from_rcm = *instrument_.camera_from_rcm;
    auto q = configuration_through(camera_from_rcm, seen.camera_from_marker.translation).value_or(JointVector{});
    const Rigid3 unturned = camera_from_marker(instrument_.marker, camera_from_rcm * rcm_from_unrolled(q), 0);
    q.psi_rad = rotation_vector_of(unturned.rotation.conjugate() * seen.camera_from_marker.rotation).z();
    const double off = q.vector()[i] - (hypothesis_.cause == Cause::sign ? -1 : 1) * seen.q[i];
    x[i] = (i == 2 ? off : wrap_pi(off)) / sigmas_[i];
    return x;
  }

  bool has(int number) const { return sigmas_[number] > 0; }

 private:
  Rigid3 pose(const JointsAndMarker& seen, const Numbers& by) const {
    Eigen::Vector4d q = seen.q - by[delay] * seen.rate;
    if (hypothesis_.cause == Cause::sign) q[hypothesis_.joint] *= -1;
    q += by.head<4>();
    const double part =
        hypothesis_.to_s > hypothesis_.from_s
            ? std::clamp((seen.time_s - hypothesis_.from_s) / (hypothesis_.to_s - hypothesis_.from_s), 0.0, 1.0)
            : static_cast<double>(seen.time_s > hypothesis_.from_s);
    const Six moved = by.segment<6>(registration) + part * by.segment<6>(change);
    const Rigid3& rig = *instrument_.camera_from_rcm;
    const Rigid3 camera_from_rcm{rotation_by(moved.head<3>()) * rig.rotation, rig.translation + moved.tail<3>()};
    const auto joints = JointVector::from_vector(q);
    return camera_from_marker(instrument_.marker, camera_from_rcm * rcm_from_unrolled(joints), joints.psi_rad);
  }

  const Instrument& instrument_;
  Hypothesis hypothesis_;
  Numbers sigmas_;
};

struct Sums {
  Normal information = Normal::Identity();
  Numbers gradient = Numbers::Zero();
  double misfit = 0, cost = 0;
};

Sums sum(const Model& model, const std::vector<JointsAndMarker>& seen, const Numbers& x, bool with_slopes) {
  constexpr double step = 1e-4;
  const double weight = std::min(1.0, independent_images / static_cast<double>(seen.size()));
  Sums sums;
  for (const JointsAndMarker& one : seen) {
    const Six errors = model.errors(one, x);
    sums.misfit += weight * errors.squaredNorm();
    if (!with_slopes) continue;
    Eigen::Matrix<double, 6, size> slopes = Eigen::Matrix<double, 6, size>::Zero();
    for (int i = 0; i < size; ++i)
      if (model.has(i)) slopes.col(i) = (model.errors(one, x + step * Numbers::Unit(i)) - errors) / step;
    sums.information += weight * slopes.transpose() * slopes;
    sums.gradient += weight * slopes.transpose() * errors;
  }
  sums.cost = sums.misfit + x.squaredNorm();
  sums.gradient += x;
  return sums;
}

struct Weighed {
  Hypothesis hypothesis;
  double evidence = -std::numeric_limits<double>::infinity();  // its logarithm
  double misfit = 0;
};

// By Levenberg and Marquardt's method, then Laplace's.
Weighed weigh(const Hypothesis& hypothesis, const std::vector<JointsAndMarker>& seen, const Instrument& instrument) {
  constexpr int max_iterations = 30;
  const Model model(instrument, hypothesis);
  Numbers x = model.start(seen.back());
  Sums at = sum(model, seen, x, true);
  double damping = 1e-3;
  for (int i = 0; i < max_iterations && damping < 1e8; ++i) {
    Normal damped = at.information;
    damped.diagonal() *= 1 + damping;
    const Numbers there = x - Numbers(solve_symmetric(damped, at.gradient));
    if (!(sum(model, seen, there, false).cost < at.cost)) {
      damping *= 10;
      continue;
    }
    const double before = at.cost;
    x = there;
    damping /= 10;
    at = sum(model, seen, x, true);
    if (before - at.cost < 1e-3) break;
  }
  const double volume = eigenvalues_of_symmetric(at.information).array().log().sum();
  return {hypothesis, -(at.cost + volume) / 2, at.misfit};
}

// At one time or on to the end, from some image on.
std::vector<Hypothesis> changes(const std::vector<JointsAndMarker>& seen) {
  constexpr std::size_t places = 8;
  std::vector<Hypothesis> all;
  const std::size_t step = std::max<std::size_t>(1, seen.size() / places);
  for (std::size_t back = 2; back < seen.size(); back += back < 6 ? 1 : step) {
    const double from_s = seen[seen.size() - back].time_s;
    all.push_back({Cause::moved, 0, from_s, from_s});
    all.push_back({Cause::moved, 0, from_s, seen.back().time_s});
  }
  return all;
}

std::vector<Hypothesis> wrong_rigs() {
  std::vector<Hypothesis> all{{Cause::registration}};
  for (int i = 0; i < 4; ++i) all.push_back({Cause::sign, i}), all.push_back({Cause::offset, i});
  return all;
}

// The most likely first; an impossible one where there is none.
std::vector<Weighed> weigh_all(const std::vector<Hypothesis>& hypotheses, const std::vector<JointsAndMarker>& seen,
                               const Instrument& instrument) {
  std::vector<Weighed> all{{}};
  for (const Hypothesis& hypothesis : hypotheses) all.push_back(weigh(hypothesis, seen, instrument));
  std::sort(all.begin(), all.end(), [](const Weighed& a, const Weighed& b) { return a.evidence > b.evidence; });
  return all;
}

}  // namespace

Explanation explain_disagreement(const std::vector<JointsAndMarker>& seen, const Instrument& instrument) {
  if (seen.empty() || !instrument.camera_from_rcm) return {};
  const Weighed right = weigh({Cause::none}, seen, instrument);
  std::vector<Weighed> rig = weigh_all(wrong_rigs(), seen, instrument);
  const double moved = weigh_all(changes(seen), seen, instrument).front().evidence;
  const Weighed &best = rig[0], &next = rig[1];
  const double numbers = 6 * std::min(independent_images, static_cast<double>(seen.size()));
  const double others = std::max(right.evidence, moved);
  if (right.evidence >= std::max(best.evidence, moved)) return {Cause::none};
  if (moved > std::max(best.evidence, right.evidence) + plain_odds) return {Cause::moved};
  if (best.evidence < others + safe_odds || best.misfit > worst_misfit * numbers) return {};
  if (best.evidence < next.evidence + plain_odds) return {Cause::rig};
  return {best.hypothesis.cause, best.hypothesis.joint};
}

std::string Explanation::text(const Instrument& instrument) const {
  static constexpr std::array<const char*, 4> names{"theta", "phi", "rho", "psi"};
  constexpr auto remedy = "run lapservo calibrate registration";
  const auto i = static_cast<std::size_t>(joint);
  const std::string name = instrument.joints ? instrument.joints->names[i] : names[i];
  switch (cause) {
    case Cause::sign:
      return fmt::format("joints.sign of {} is wrong: {}", name, remedy);
    case Cause::offset:
      return fmt::format("joints.offset of {} is wrong: {}", name, remedy);
    case Cause::registration:
      return fmt::format("camera_from_rcm is wrong, or the camera shows another arm: {}", remedy);
    case Cause::rig:
      return fmt::format(
          "joints.sign, joints.offset or camera_from_rcm is wrong, the motion so far does not show which: {}", remedy);
    default:
      return "";
  }
}

}  // namespace lapservo::internal
