#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string>

#include <Eigen/Core>

#include "lapservo/kinematics/features.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/tool/tool.h"
#include "lapservo/vision/status.h"

namespace lapservo {

/// Four points at zero: Eigen's own default is whatever memory holds.
inline std::array<Eigen::Vector2d, 4> zero_points() {
  const Eigen::Vector2d zero = Eigen::Vector2d::Zero();
  return {zero, zero, zero, zero};
}

/// The measurement of one instrument in one frame. Its numbers are meaningful only when `status` is Status::ok; then
/// every one is finite. Sigmas are one standard deviation.
struct Observation {
  static constexpr double false_rad = 0.1;  ///< psi that is off by more is wrong
  static constexpr double usual_max_p_false = 1e-3;

  Status status = Status::no_marker;
  std::string instrument;  ///< its name in the rig

  /// Present when the instrument's camera_from_rcm is known; covariance in the order theta, phi, rho, psi: of the
  /// frame's noise and of what the rig's sigmas say of registration, print, camera and response (docs/rig.md).
  struct Rcm {
    JointVector q;
    Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  };
  std::optional<Rcm> rcm;

  /// Method::surface only. With camera_from_rcm or without. Origin at the marker's proximal end on the axis, z along
  /// the axis to the tip, x towards tau = 0.
  struct MarkerPose {
    Rigid3 camera_from_marker;
    double sigma_xy_m = 0;      ///< of the origin across the camera's axis: root mean square of x's and y's
    double sigma_z_m = 0;       ///< of its depth
    double sigma_axis_rad = 0;  ///< of the angle between the axis and the true one: root of both components' squares
    double sigma_roll_rad = 0;  ///< about the axis
    /// Origin [m], then rotation vector [rad], in the camera's axes.
    TipInMarker::Covariance covariance = TipInMarker::Covariance::Zero();
  };
  std::optional<MarkerPose> marker;

  /// With MarkerPose, a tool whose place the rig says and, for a wrist, its joints' readings (Tracker::set_wrist()).
  struct Tip {
    Rigid3 camera_from_tip;
    /// Position [m], then rotation vector [rad], in the camera's axes.
    TipInMarker::Covariance covariance = TipInMarker::Covariance::Zero();
    /// Parts of sigma_m(): by the shaft as it is seen, by the tool's place in the rig, by the readings of the wrist.
    double sigma_shaft_m = 0, sigma_place_m = 0, sigma_readings_m = 0;
    /// How far the true tip is: root of all three axes' variances.
    double sigma_m() const { return std::sqrt(covariance.topLeftCorner<3, 3>().trace()); }
  };
  std::optional<Tip> tip;

  double tau_rad = 0;  ///< azimuth of the marker on the centre line, [0, 2 pi)
  double sigma_tau_rad = 0;
  std::array<Eigen::Vector2d, 4> edges_ideal_px = zero_points();  ///< e0..e3 on the centre line
  std::array<Eigen::Vector2d, 4> edges_raw_px = zero_points();
  /// Covariance of edges_ideal_px, as the image alone or with camera_from_rcm was fitted; to first order. Singular: the
  /// points lie on a line and move with the pose.
  EdgesCovariance edges_covariance_px2 = EdgesCovariance::Zero();
  Features features;  ///< their covariance: features_covariance()

  /// Method::surface only: the probability that the rotation about the shaft is off by more than false_rad, since the
  /// print is not the rig's or as sigma has it.
  std::optional<double> p_false;

  /// Where the fitted shaft lies, to start the next frame from and to draw. camera_from_unrolled, psi.
  Rigid3 camera_from_unrolled;
  double psi_rad = 0;  ///< in the azimuth reference of camera_from_unrolled

  /// In a frame that is not ok: what was taken for the marker and refused. To be drawn, so that a person sees why; for
  /// nothing else, since it may lie anywhere. Finite.
  struct Refused {
    enum class What { nothing, pose, edges } what = What::nothing;
    Rigid3 camera_from_unrolled;  ///< of Method::surface, with psi_rad about it
    double psi_rad = 0;
    std::array<Eigen::Vector2d, 4> edges_raw_px = zero_points();  ///< of Method::centerline
  };
  Refused refused;
};

/// The tip behind the marker of an observation by readings of the wrist's joints, none for a straight tool: what
/// Observation::tip is to be. Nullopt without a marker's pose, without the tool's place and without readings of its
/// wrist. Throws InputError as tip_in_marker() does.
std::optional<Observation::Tip> tip_of(const Observation& seen, const Tool& tool, std::span<const double> wrist_rad);

}  // namespace lapservo
