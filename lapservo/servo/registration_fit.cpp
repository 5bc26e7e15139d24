#include "lapservo/servo/registration_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "lapservo/core/dense_matrix.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/registration_covariance.h"

namespace lapservo::internal {
namespace {

using Edges = Eigen::Matrix<double, 8, 1>;

// Noise of a boundary's image, and what counts as an outlier: multiples of it.
constexpr double sigma_px = 0.1, loss_sigmas = 10;

// Errors that all images share (film, lens, print) do not average out: so many images count as one.
constexpr double alike_images = 20;

// Theta's offset is camera_from_rcm's; gaps are those beyond what q has crossed.
ArmHypothesis small_offsets() {
  constexpr double anywhere_rad = 3, anywhere_m = 1;
  ArmHypothesis hypothesis;
  hypothesis.sigmas.segment<4>(arm::offset) << 0, 3e-3, 3e-4, 0.02;
  hypothesis.sigmas[arm::delay] = 0.01;
  hypothesis.sigmas.segment<3>(arm::rotation).setConstant(anywhere_rad);
  hypothesis.sigmas.segment<3>(arm::translation).setConstant(anywhere_m);
  hypothesis.sigmas.segment<2>(arm::gap) << 2e-4, 0.03;
  return hypothesis;
}

std::optional<Edges> edges_of(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled) {
  const auto line = centre_line(camera, marker, camera_from_unrolled, 0);
  if (!line) return std::nullopt;
  Edges edges;
  for (std::size_t k = 0; k < 4; ++k) edges.segment<2>(2 * static_cast<Eigen::Index>(k)) = line->ideal_px[k];
  return edges;
}

// Zero of a marker that is not in view.
Eigen::Matrix<double, 6, 6> whitening_by_edges(const Camera& camera, const Marker& marker, const Rigid3& seen) {
  constexpr double step = 1e-6;
  const Rigid3 marker_from_unrolled = camera_from_marker(marker, {}, 0).inverse();
  const auto moved = [&](const Eigen::Matrix<double, 6, 1>& by) {
    const Rigid3 pose{rotation_by(by.tail<3>()) * seen.rotation, seen.translation + by.head<3>()};
    return edges_of(camera, marker, pose * marker_from_unrolled);
  };
  const auto at = moved(Eigen::Matrix<double, 6, 1>::Zero());
  Eigen::Matrix<double, 8, 6> slopes;
  for (int i = 0; i < 6; ++i) {
    const Eigen::Matrix<double, 6, 1> by = step * Eigen::Matrix<double, 6, 1>::Unit(i);
    const auto more = moved(by), less = moved(-by);
    if (!at || !more || !less) return Eigen::Matrix<double, 6, 6>::Zero();
    const Edges up = *more - *at, down = *at - *less;  // over the seam the inner boundaries jump
    slopes.col(i) = (up.squaredNorm() < down.squaredNorm() ? up : down) / (step * sigma_px);
  }
  const Eigen::HouseholderQR<Eigen::Matrix<double, 8, 6>> factor(slopes);
  return factor.matrixQR().topRows<6>().triangularView<Eigen::Upper>();
}

Eigen::Matrix3d symmetric_root(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(matrix);
  return parts.eigenvectors() * parts.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal() *
         parts.eigenvectors().transpose();
}

// Where the sighting alone puts the RCM frame.
Rigid3 camera_from_rcm_by(const Marker& marker, const MarkerSighting& sighting) {
  const auto q = JointVector::from_vector(sighting.q);
  return sighting.camera_from_marker * camera_from_marker(marker, rcm_from_unrolled(q), q.psi_rad).inverse();
}

}  // namespace

std::optional<SeenJoints> seen_joints(const Camera& camera, const Instrument& instrument,
                                      const MarkerSighting& sighting, const Eigen::Vector4d& offset) {
  constexpr int iterations = 3;
  constexpr double step = 1e-6;
  const Eigen::Matrix<double, 6, 6> whitening =
      whitening_by_edges(camera, instrument.marker, sighting.camera_from_marker);
  const auto errors = [&](const Eigen::Vector4d& at,
                          const Eigen::Vector3d& rcm_by_m = Eigen::Vector3d::Zero()) -> Eigen::Matrix<double, 6, 1> {
    const auto q = JointVector::from_vector(sighting.q + at);
    Rigid3 unrolled = *instrument.camera_from_rcm * rcm_from_unrolled(q);
    unrolled.translation += rcm_by_m;
    return whitening *
           pose_difference(camera_from_marker(instrument.marker, unrolled, q.psi_rad), sighting.camera_from_marker);
  };
  SeenJoints seen{offset};
  const double rad = sigma_px / camera.fx_px;
  Eigen::Matrix<double, 6, 4> slopes;
  for (int i = 0; i < iterations; ++i) {
    const Eigen::Matrix<double, 6, 1> at = errors(seen.offset);
    for (int k = 0; k < 4; ++k) slopes.col(k) = (errors(seen.offset + step * Eigen::Vector4d::Unit(k)) - at) / step;
    seen.covariance = inverse_of_symmetric(slopes.transpose() * slopes);
    seen.offset -= seen.covariance * slopes.transpose() * at;
    seen.misfit_rad = rad * (at - slopes * (seen.covariance * slopes.transpose() * at)).norm();
  }
  if (!seen.offset.allFinite() || !seen.covariance.allFinite()) return std::nullopt;
  const Eigen::Matrix<double, 6, 1> at = errors(seen.offset);
  Eigen::Matrix<double, 6, 3> by_rcm;
  for (int k = 0; k < 3; ++k) by_rcm.col(k) = (errors(seen.offset, step * Eigen::Vector3d::Unit(k)) - at) / step;
  const Eigen::Matrix<double, 6, 3> left = by_rcm - slopes * (seen.covariance * (slopes.transpose() * by_rcm));
  seen.misfit_per_m = rad * symmetric_root(left.transpose() * left);
  return seen;
}

double largest_misfit_rad(const Instrument& instrument, const SeenJoints& agreed, const SeenJoints& here) {
  constexpr double sigmas = 3, unknown_m = 3e-3;
  Eigen::Matrix3d covariance = registration_covariance(instrument).topLeftCorner<3, 3>();
  if (covariance.isZero()) covariance = unknown_m * unknown_m / 3 * Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d change = here.misfit_per_m - agreed.misfit_per_m;
  return agreed.misfit_rad + sigmas * std::sqrt((change * covariance * change).trace());
}

std::optional<RegistrationFit> fit_registration(const Camera& camera, const Marker& marker,
                                                const std::vector<MarkerSighting>& sightings, const GapPath& path) {
  if (sightings.empty()) return std::nullopt;
  ArmData data{marker, camera_from_rcm_by(marker, sightings.back()), sightings, {}, loss_sigmas, 1 / alike_images,
               path};
  for (const MarkerSighting& one : sightings)
    data.whitening.push_back(whitening_by_edges(camera, marker, one.camera_from_marker));
  const auto found = fit_arm(data, small_offsets());
  if (!found) return std::nullopt;
  const double px = sigma_px / std::sqrt(8.0);
  RegistrationFit fit{moved_by(found->numbers, data.camera_from_rcm), {}, px * found->rms, px * found->newest_rms};
  const double worse = std::max(1.0, fit.rms_px / sigma_px);
  const auto registration = [&](int row, int column) {
    return worse * worse * found->covariance.block<3, 3>(row, column);
  };
  fit.covariance << registration(arm::translation, arm::translation), registration(arm::translation, arm::rotation),
      registration(arm::rotation, arm::translation), registration(arm::rotation, arm::rotation);
  return fit;
}

}  // namespace lapservo::internal
