#include "lapservo/calibration/marker/marker_measurement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t min_seam_frames = 8;
// A seam and psi's offset are one number: as well known as a registration's rotation has to be.
constexpr double max_sigma_seam_rad = 0.02;
// One sigma, about 0, of a delay that the rig lacks: that of usual cameras.
constexpr double unknown_delay_s = 0.3;

// Where the recording has that time.
double psi_at(const JointRecording& recording, const Joints& joints, double time_s) {
  return q_from_joints(joints, Eigen::Vector4d(recording.at(time_s).value().data()))[3];
}

// How fast the joint turns psi.
double rate_at(const JointRecording& recording, const Joints& joints, double time_s) {
  constexpr double around_s = 0.05;
  const double from_s = recording.at(time_s - around_s) ? time_s - around_s : time_s,
               to_s = recording.at(time_s + around_s) ? time_s + around_s : time_s;
  return from_s < to_s ? (psi_at(recording, joints, to_s) - psi_at(recording, joints, from_s)) / (to_s - from_s) : 0;
}

// psi in the RCM's azimuths of a shaft in a free pose: its axis as theta and phi have it, its turn about that.
double psi_of(const ShaftPose& pose, const Rigid3& camera_from_rcm) {
  const Eigen::Matrix3d axes =
      (camera_from_rcm.rotation.conjugate() * pose.camera_from_unrolled.rotation).toRotationMatrix();
  const Eigen::Vector3d axis = axes.col(2);
  const double theta_rad = std::atan2(axis.y(), axis.x()), phi_rad = std::atan2(axis.head<2>().norm(), axis.z());
  const Eigen::Matrix3d unrolled = rcm_from_unrolled({theta_rad, phi_rad, 0, 0}).rotation.toRotationMatrix();
  const Eigen::Vector3d x = unrolled.transpose() * axes.col(0);
  return pose.psi_rad + std::atan2(x.y(), x.x());
}

}  // namespace

MarkerCalibration measure_marker(const Rig& rig, std::size_t index, const FrameRecording& recording,
                                 const std::optional<JointInput>& joints, const JobWatch& watch) {
  constexpr int enough = 400;  // frames of a video lie close together: more of them add no information
  const Instrument& instrument = rig.instruments[index];
  KeyFrames key_frames(rig, index);
  FrameDiagnosis diagnosis(rig);
  const FramesRead read =
      read_frames(recording, rig, every_of(recording.source, enough), watch, [&](const cv::Mat& bgr, double time_s) {
        if (!key_frames.add(bgr, time_s)) diagnosis.add(bgr, {});
        return fmt::format(", {} in {}", instrument.name, key_frames.found());
      });
  MarkerCalibration calibration;
  const int found = key_frames.found();
  if (read.stopped) {
    calibration.refusal = "stopped";
  } else if (found == 0) {
    calibration.refusal = fmt::format("{} is in none of {} frames{}: look at the rig's hues_deg and diameter_m{}",
                                      instrument.name, read.looked_at, read.remark_on_damaged(), diagnosis.cause());
  } else {
    calibration = calibrate_marker(rig, index, key_frames.take(), watch);
    if (!calibration.refusal.empty() && 2 * found < read.looked_at && !watch.stopped())
      calibration.refusal += diagnosis.cause();
  }
  calibration.found = found, calibration.read = read;
  if (read.jpegs == read.looked_at) calibration.seam_may_lag = false;
  if (!joints || !calibration.refusal.empty()) return calibration;
  const SeamRegistration seam = register_seam(instrument, calibration, joints->recording);
  if (!seam.refusal.empty()) throw InputError(joints->source, seam.refusal);
  calibration.marker.seam_rad = seam.seam_rad;
  calibration.marker.sigmas.seam_rad = seam.sigma_rad;
  return calibration;
}

void expect_registration(const Instrument& instrument, const std::string& rig, const std::string& joints_option) {
  for (const auto& [there, key] : {std::pair{instrument.camera_from_rcm.has_value(), "camera_from_rcm"},
                                   {instrument.joints.has_value(), "joints"}})
    if (!there)
      throw InputError(
          rig, fmt::format("{} needs {} of {}, which the rig lacks: leave it out, or calibrate registration before",
                           joints_option, key, instrument.name));
}

std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const Marker& after, bool with_seam) {
  std::vector<CalibratedNumber> numbers;
  const auto add = [&](const std::string& name, double was, double is, double sigma) {
    numbers.push_back({name, 1e3 * was, 1e3 * is, 1e3 * sigma});
  };
  const MarkerSigmas& sigmas = after.sigmas;
  for (std::size_t i = 0; i < 3; ++i)
    add(fmt::format("bands_upper_m[{}] [mm]", i), before.bands_upper_m[i], after.bands_upper_m[i],
        (*sigmas.bands_upper_m)[i]);
  for (std::size_t i = 0; i < 3; ++i)
    add(fmt::format("bands_lower_m[{}] [mm]", i), before.bands_lower_m[i], after.bands_lower_m[i],
        (*sigmas.bands_lower_m)[i]);
  add("wrap_m [mm]", before.wrap_m, after.wrap_m, sigmas.wrap_m.value());
  add("skew_m [mm]", before.skew_m, after.skew_m, sigmas.skew_m.value());
  add("gap_rad [mrad]", before.gap_rad, after.gap_rad, sigmas.gap_rad.value());
  if (with_seam) add("seam_rad [mrad]", before.seam_rad, after.seam_rad, sigmas.seam_rad.value());
  return numbers;
}

SeamRegistration register_seam(const Instrument& instrument, const MarkerCalibration& calibration,
                               const JointRecording& recording) {
  SeamRegistration result;
  const Marker& marker = calibration.marker;
  std::vector<double> times_s, seen_rad, rates;
  double first_s = 1e300, last_s = -1e300;
  for (const KeyFrame& frame : calibration.key_frames) {
    const double time_s = frame.time_s - instrument.image_delay_s.value_or(0);
    first_s = std::min(first_s, time_s), last_s = std::max(last_s, time_s);
    if (!recording.at(time_s)) continue;
    times_s.push_back(time_s);
    seen_rad.push_back(psi_of(frame.sighting.unknowns.pose(), instrument.camera_from_rcm.value()));
    rates.push_back(rate_at(recording, instrument.joints.value(), time_s));
  }
  result.frames = times_s.size();
  if (times_s.size() < min_seam_frames) {
    result.refusal = fmt::format(
        "{} frames lie within the recording of the joints, at least {} are needed: the frames run from {:.2f} to "
        "{:.2f} s, the recording from {:.2f} to {:.2f} s",
        times_s.size(), min_seam_frames, first_s, last_s, recording.time_s.front(), recording.time_s.back());
    return result;
  }
  const JointRecording readings = refined(recording, 5e-3);
  const auto differences = [&](double about_rad, double gap_rad, double later_s) {
    JointRecording behind = readings;
    put_behind_gap(behind, 3, gap_rad);
    std::vector<double> all;
    for (std::size_t i = 0; i < times_s.size(); ++i)
      all.push_back(wrap_pi(seen_rad[i] - psi_at(behind, instrument.joints.value(), times_s[i]) + rates[i] * later_s -
                            about_rad));
    return all;
  };
  // About the direction of most, then the median, then with the gap and the delay.
  double sine = 0, cosine = 0;
  for (const double d : differences(0, 0, 0)) sine += std::sin(d), cosine += std::cos(d);
  const double direction_rad = std::atan2(sine, cosine);
  const double about_rad = direction_rad + median(differences(direction_rad, 0, 0));
  constexpr double widest_rad = 0.2, step_rad = 1e-4, step_s = 1e-4, unit_rad = 1e-3, exact_s = 1e-6;
  // The middle of the gap is where registration has the joints' offset. A turn one way leaves the gap open: gaps of up
  // to 40 mrad are usual (docs/statuses.md).
  const double gap_sigma_rad = 0.04 / std::sqrt(3.0);
  // The same holds for what the delay is off by: there and back it shows, as a gap does, one way it moves the seam.
  const double delay_sigma_s =
      instrument.image_delay_s ? std::max(exact_s, instrument.sigma_image_delay_s.value_or(exact_s)) : unknown_delay_s;
  const std::optional<FrameFit> fit = fit_frames(
      [&](const Eigen::VectorXd& x) -> Eigen::MatrixXd {
        const std::vector<double> off_rad = differences(about_rad + x[0], x[1], x[2]);
        return Eigen::RowVectorXd::Map(off_rad.data(), static_cast<Eigen::Index>(off_rad.size())) / unit_rad;
      },
      {{0, step_rad}, {0, step_rad, gap_sigma_rad}, {0, step_s, delay_sigma_s}}, 1);
  const Eigen::RowVectorXd sizes = fit ? Eigen::RowVectorXd(fit->residuals.row(0).cwiseAbs()) : Eigen::RowVectorXd();
  if (!fit || unit_rad * rms_but_tenth({sizes.begin(), sizes.end()}) > widest_rad) {
    result.refusal =
        "the joints do not turn as the marker does: check joints.sign, the recording's clock and image_delay_s";
    return result;
  }
  // A pose was found with marker.seam_rad: what psi is too large by, the seam lies farther.
  result.seam_rad = wrap_pi(marker.seam_rad + about_rad + fit->x[0]);
  result.sigma_rad = std::sqrt(covariance_at_least(fit->covariance, fit->independent)(0, 0));
  if (result.sigma_rad > max_sigma_seam_rad)
    result.refusal = fmt::format(
        "the seam would be known to {:.0f} mrad only, expected {:.0f} or less{}: turn the instrument there and "
        "back, or measure image_delay_s of these recordings by lapservo align",
        1e3 * result.sigma_rad, 1e3 * max_sigma_seam_rad,
        instrument.image_delay_s ? "" : ", as the rig has no image_delay_s and the turn does not show it");
  return result;
}

}  // namespace lapservo::internal
