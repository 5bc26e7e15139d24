#include "lapservo/calibration/registration/registration_measurement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/rounded_covariance.h"
#include "lapservo/core/rounded_sigma.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {
namespace {

constexpr int enough_images = 3600;
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

template <std::size_t N, typename Numbers>
std::array<double, N> rounded_sigmas(const Numbers& sigmas) {
  std::array<double, N> rounded;
  std::transform(sigmas.begin(), sigmas.end(), rounded.begin(), rounded_sigma);
  return rounded;
}

TimedPose pose_in(const CsvTable& table, std::size_t row, const std::string& source) {
  const auto number = [&](const char* column) { return table.number(row, column); };
  const auto sigma = [&](const char* column) {
    if (const double value = number(column); value > 0) return value;
    throw InputError(source, "row " + std::to_string(row + 1) + ": " + column, table.text(row, column), "above 0");
  };
  TimedPose pose;
  pose.time_s = number("time_s");
  pose.marker.camera_from_marker.translation = {number("marker_x_m"), number("marker_y_m"), number("marker_z_m")};
  const Eigen::Quaterniond rotation(number("marker_qw"), number("marker_qx"), number("marker_qy"), number("marker_qz"));
  if (!(std::abs(rotation.norm() - 1) < 2e-4) || !(pose.origin().norm() > 0))
    throw InputError(source, "row " + std::to_string(row + 1) + ": marker pose", "no pose",
                     "a unit quaternion and a place before the camera");
  pose.marker.camera_from_marker.rotation = rotation.normalized();
  pose.marker.sigma_xy_m = sigma("sigma_marker_xy_m"), pose.marker.sigma_z_m = sigma("sigma_marker_z_m");
  pose.marker.sigma_axis_rad = sigma("sigma_axis_rad"), pose.marker.sigma_roll_rad = sigma("sigma_roll_rad");
  return pose;
}

}  // namespace

MeasuredPoses poses_in_frames(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                              const JobWatch& watch) {
  Rig free = rig;
  for (Instrument& each : free.instruments) each.camera_from_rcm.reset();
  Tracker tracker(free, {.frame_budget = std::nullopt});
  const std::string& name = rig.instruments[instrument].name;
  FrameDiagnosis diagnosis(free);
  MeasuredPoses poses;
  poses.read = read_frames(recording, free, every_of(recording.source, enough_images), watch,
                           [&](const cv::Mat& bgr, double time_s) {
                             const auto& observations = tracker.track(bgr);
                             diagnosis.add(bgr, observations);
                             const Observation& seen = observations[instrument];
                             if (seen.status == Status::ok && seen.marker) poses.all.push_back({time_s, *seen.marker});
                             return fmt::format(", {} in {}", name, poses.all.size());
                           });
  if (poses.read.stopped)
    poses.none = "stopped";
  else if (poses.all.empty())
    poses.none = fmt::format("{} is in none of {} frames{}{}", name, poses.read.looked_at,
                             poses.read.remark_on_damaged(), diagnosis.cause());
  return poses;
}

MeasuredPoses poses_in_table(const std::filesystem::path& path, const std::string& instrument) {
  const CsvTable table = CsvTable::read(path);
  MeasuredPoses poses;
  int rows = 0, with_rcm = 0, without_pose = 0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.text(row, "instrument") != instrument) continue;
    ++rows;
    if (table.text(row, "status") != "ok") continue;
    if (table.text(row, "marker_x_m").empty()) {
      ++without_pose;
      continue;
    }
    if (!table.text(row, "theta_rad").empty()) {
      ++with_rcm;
      continue;
    }
    const TimedPose pose = pose_in(table, row, path.string());
    if (!poses.all.empty() && !(pose.time_s > poses.all.back().time_s))
      throw InputError(path.string(), "row " + std::to_string(row + 1) + ": time_s", table.text(row, "time_s"),
                       "later than the row before: the clock jumps");
    poses.all.push_back(pose);
  }
  if (with_rcm > 0 && poses.all.empty())
    poses.none = fmt::format(
        "its {} rows were measured with a camera_from_rcm, through which their axes pass whether it is right or not: "
        "give the images, or track them with a rig without it",
        with_rcm);
  else if (without_pose > 0 && poses.all.empty())
    poses.none = fmt::format(
        "its {} rows that are ok have no pose of the marker (marker_x_m), as --method centerline has none: give the "
        "images, or track them with --method surface",
        without_pose);
  else if (rows == 0)
    poses.none = fmt::format("has no row of {}", instrument);
  return poses;
}

Instrument registered(Instrument instrument, const Registration& registration) {
  const bool keeps_rotation = instrument.camera_from_rcm && instrument.camera_from_rcm->rotation.coeffs() ==
                                                                registration.camera_from_rcm.rotation.coeffs();
  instrument.camera_from_rcm = registration.camera_from_rcm;
  instrument.sigma_translation_m = rounded_sigmas<3>(registration.sigma_translation_m);
  if (!keeps_rotation) instrument.sigma_quaternion_xyzw.reset(), instrument.registration_covariance.reset();
  if (auto& covariance = instrument.registration_covariance) {
    const Eigen::Matrix3d of_translation = registration.sigma_translation_m.cwiseAbs2().asDiagonal();
    covariance->topLeftCorner<3, 3>() = rounded_covariance(of_translation);
    covariance->topRightCorner<3, 3>().setZero(), covariance->bottomLeftCorner<3, 3>().setZero();
  }
  if (registration.sigma_quaternion)
    instrument.sigma_quaternion_xyzw = rounded_sigmas<4>(*registration.sigma_quaternion);
  if (!registration.arm) return instrument;
  instrument.registration_covariance = rounded_covariance(
      in_camera_axes(registration.camera_from_rcm, registration.arm->covariance.topLeftCorner<6, 6>()));
  instrument.joints = registration.arm->joints;
  instrument.joints->sigma_offset = rounded_sigmas<4>(registration.arm->sigma_offset);
  instrument.image_delay_s = registration.arm->image_delay_s;
  instrument.sigma_image_delay_s = rounded_sigma(registration.arm->sigma_image_delay_s);
  return instrument;
}

std::vector<CalibratedNumber> registered_numbers(const Instrument& before, const Registration& registration) {
  std::vector<CalibratedNumber> numbers;
  const auto add = [&](const std::string& name, double was, double is, double sigma) {
    numbers.push_back({name, 1e3 * was, 1e3 * is, 1e3 * sigma});
  };
  constexpr std::array<const char*, 3> axes{"x", "y", "z"};
  const auto& was = before.camera_from_rcm;
  for (Eigen::Index i = 0; i < 3; ++i)
    add(fmt::format("camera_from_rcm {} [mm]", axes[static_cast<std::size_t>(i)]), was ? was->translation[i] : unknown,
        registration.camera_from_rcm.translation[i], registration.sigma_translation_m[i]);
  if (registration.sigma_quaternion)
    add("its rotation [mrad]", was ? was->rotation.angularDistance(registration.camera_from_rcm.rotation) : unknown, 0,
        registration.sigma_rotation_rad);
  if (!registration.arm) return numbers;
  const Registration::Arm& arm = *registration.arm;
  constexpr std::array<const char*, 4> units{"theta [mrad]", "phi [mrad]", "rho [mm]", "psi [mrad]"};
  for (std::size_t i = 1; i < 4; ++i)
    add(fmt::format("offset of {}", units[i]), before.joints->offset[i], arm.joints.offset[i], arm.sigma_offset[i]);
  add("image_delay_s [ms]", before.image_delay_s.value_or(unknown), arm.image_delay_s, arm.sigma_image_delay_s);
  return numbers;
}

}  // namespace lapservo::internal
