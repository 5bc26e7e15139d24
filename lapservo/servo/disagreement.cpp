#include "lapservo/servo/disagreement.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/rcm_kinematics.h"

namespace lapservo::internal {
namespace {

using Cause = Explanation::Cause;

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

// Odds of 20 and of 150, as logarithms; and errors of an image that no cause in the list explains.
constexpr double plain_odds = 3, safe_odds = 5, worst_rms = 7.3;

struct Hypothesis : ArmHypothesis {
  Cause cause = Cause::none;
  int joint = 0;
};

Hypothesis hypothesis_of(Cause cause, int joint = 0) {
  Hypothesis hypothesis;
  hypothesis.cause = cause, hypothesis.joint = joint;
  ArmNumbers& sigmas = hypothesis.sigmas;
  sigmas.head<4>() = usual_offset;
  sigmas[arm::delay] = usual_delay_s;
  const bool wrong = cause == Cause::registration;
  sigmas.segment<3>(arm::rotation).setConstant(wrong ? wrong_rotation_rad : usual_rotation_rad);
  sigmas.segment<3>(arm::translation).setConstant(wrong ? wrong_translation_m : usual_translation_m);
  if (cause == Cause::sign) hypothesis.mirrored = joint;
  if (cause == Cause::sign || cause == Cause::offset) sigmas[joint] = wrong_offset[joint];
  if (cause != Cause::moved) return hypothesis;
  sigmas.segment<3>(arm::change).setConstant(wrong_rotation_rad);
  sigmas.segment<3>(arm::change + 3).setConstant(wrong_translation_m);
  return hypothesis;
}

// The line of sight is known to less than what lies across it, and a turn about the axis to less than the axis.
Eigen::Matrix<double, 6, 6> whitening_of_pose(const Rigid3& camera_from_marker) {
  const double distance_m = camera_from_marker.translation.norm();
  const Eigen::Vector3d sight = camera_from_marker.translation / distance_m, across = sight.unitOrthogonal();
  const Eigen::Vector3d axis = camera_from_marker.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d tilt = axis.cross(sight).normalized(), side = axis.cross(tilt);
  Eigen::Matrix<double, 6, 6> whitening = Eigen::Matrix<double, 6, 6>::Zero();
  whitening.topLeftCorner<3, 3>() << across.transpose() / sigma_across_m,
      sight.cross(across).transpose() / sigma_across_m, sight.transpose() / (sigma_depth * distance_m);
  whitening.bottomRightCorner<3, 3>() << side.transpose() / sigma_axis_rad, tilt.transpose() / sigma_foreshortening_rad,
      axis.transpose() / sigma_roll_rad;
  return whitening;
}

ArmData data_of(const std::vector<MarkerSighting>& seen, const Instrument& instrument) {
  ArmData data{instrument.marker, *instrument.camera_from_rcm, seen};
  for (const MarkerSighting& one : seen) data.whitening.push_back(whitening_of_pose(one.camera_from_marker));
  data.weight = std::min(1.0, independent_images / static_cast<double>(seen.size()));
  return data;
}

// The wrong offset by the latest image alone.
ArmNumbers start_of(const Hypothesis& hypothesis, const ArmData& data) {
  ArmNumbers x = ArmNumbers::Zero();
  const int i = hypothesis.joint;
  if (hypothesis.cause != Cause::sign && hypothesis.cause != Cause::offset) return x;
  const MarkerSighting& seen = data.sightings.back();
  const JointVector q =
      configuration_of_marker(data.marker, data.camera_from_rcm, seen.camera_from_marker).value_or(JointVector{});
  const double off = q.vector()[i] - (hypothesis.mirrored ? -1 : 1) * seen.q[i];
  x[i] = i == 2 ? off : wrap_pi(off);
  return x;
}

struct Weighed {
  Hypothesis hypothesis;
  double evidence = -std::numeric_limits<double>::infinity();  // its logarithm
  double rms = 0;
};

Weighed weigh(const Hypothesis& hypothesis, const ArmData& data) {
  const auto fit = fit_arm(data, hypothesis, start_of(hypothesis, data));
  return fit ? Weighed{hypothesis, fit->evidence, fit->rms} : Weighed{hypothesis};
}

// At one time or on to the end, from some image on.
std::vector<Hypothesis> changes(const std::vector<MarkerSighting>& seen) {
  constexpr std::size_t places = 8;
  std::vector<Hypothesis> all;
  const std::size_t step = std::max<std::size_t>(1, seen.size() / places);
  for (std::size_t back = 2; back < seen.size(); back += back < 6 ? 1 : step) {
    const double from_s = seen[seen.size() - back].time_s;
    for (const double to_s : {from_s, seen.back().time_s}) {
      all.push_back(hypothesis_of(Cause::moved));
      all.back().from_s = from_s, all.back().to_s = to_s;
    }
  }
  return all;
}

std::vector<Hypothesis> wrong_rigs() {
  std::vector<Hypothesis> all{hypothesis_of(Cause::registration)};
  for (int i = 0; i < 4; ++i)
    for (const Cause cause : {Cause::sign, Cause::offset}) all.push_back(hypothesis_of(cause, i));
  return all;
}

// The most likely first; an impossible one where there is none.
std::vector<Weighed> weigh_all(const std::vector<Hypothesis>& hypotheses, const ArmData& data) {
  std::vector<Weighed> all{{}};
  for (const Hypothesis& hypothesis : hypotheses) all.push_back(weigh(hypothesis, data));
  std::sort(all.begin(), all.end(), [](const Weighed& a, const Weighed& b) { return a.evidence > b.evidence; });
  return all;
}

}  // namespace

Explanation explain_disagreement(const std::vector<MarkerSighting>& seen, const Instrument& instrument) {
  if (seen.empty() || !instrument.camera_from_rcm) return {};
  const ArmData data = data_of(seen, instrument);
  const Weighed right = weigh(hypothesis_of(Cause::none), data);
  const std::vector<Weighed> rig = weigh_all(wrong_rigs(), data);
  const double moved = weigh_all(changes(seen), data).front().evidence;
  const Weighed &best = rig[0], &next = rig[1];
  const double others = std::max(right.evidence, moved);
  if (right.evidence >= std::max(best.evidence, moved)) return {Cause::none};
  if (moved > std::max(best.evidence, right.evidence) + plain_odds) return {Cause::moved};
  if (best.evidence < others + safe_odds || best.rms > worst_rms) return {};
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
