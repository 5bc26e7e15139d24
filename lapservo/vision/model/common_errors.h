#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/edges/edge_blur.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/model/print_evidence.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// A group's residuals as a straight line over the print: of boundaries in metres along the shaft, of sides a constant
/// in pixels. Zero where a group has too few points for one of its own.
struct ResidualLine {
  double at_start = 0, slope = 0;  ///< at tau = 0; a turn

  /// The rest of a residual after the line.
  double residual_px(const Measurement& m) const;
};
using ResidualLines = std::array<ResidualLine, measurement_groups>;

ResidualLines residual_lines(std::span<const Measurement> measurements);

/// Root mean square of the boundaries' residuals in sigmas, each about its own line; outliers do not count.
double scatter_sigmas(std::span<const Measurement> measurements, const ResidualLines& lines);

/// How large the errors are that measurements share, and what is uncertain in an image. Fractions are of pixels.
struct UsualErrors {
  /// The model's error of each boundary as a whole (px, times the blur's square by the shaft's radius: shading across
  /// the blur) and of each side: it does not average over lines. `accuracy_study edges` measures it.
  double boundary_of_blur = 0.12, common_side_px = 0.02;
  /// And as a fraction of the blur beyond the usual: defocus and motion do not blur like a Gaussian. All boundaries
  /// move together by more, mostly where the light comes from aside.
  double common_fraction_of_blur = 0.008, whole_fraction_of_blur = 0.02;
  /// And of the blur's square beyond a lens's, by the shaft's radius: how far sides, which are no steps, are off, and
  /// by how much all boundaries lean alike, which moved_by_blur_px() leaves; the first is of sharp images' sides.
  double usual_side_blur_px = 1.05, side_of_blur = 1.4, leaning_of_blur = 0.035;
  /// And as a fraction of what the camera's processing moves a boundary by, which is known so well; where colours are
  /// clipped beside boundaries, the larger one. A processing that moves them by doubted_processing_px (rms) doubles the
  /// noise that `calibrate marker` takes.
  double fraction_of_processing = 0.13, fraction_of_clipped = 0.3, doubted_processing_px = 0.1;
  /// By so much of it (rms) sides are off, too, and what is left of all boundaries is moved, leaning and bowed alike,
  /// of which psi feels little: without, phi had up to 2.5 of its sigmas in images with 4:2:0, and theta 2.2.
  double side_fraction_of_processing = 0.5, whole_fraction_of_processing = 0.4, leaning_fraction_of_processing = 0.1,
         bowed_fraction_of_processing = 0.3;
  /// And the uncertain part before the print is blamed: exact prints leave 0 to 0.1 px of 0.3 to 0.7 px.
  double doubted_of_processing = 0.12;
  /// The rest of a value that even that does not explain, beyond the usual: 0.012 moved boundaries by 0.1 px.
  double usual_misfit = 0.004, px_per_misfit = 8;
  /// Noise is as the scatter about the fit shows it, but no less than this part of what measurements say.
  double least_noise_scale = 0.5;
  double usual_sigma_px = 0.05;  ///< of an edge; compressed ones (--format jpg) have three times that

  /// Uncertainty before the print is blamed (PrintDoubt): by what is beyond the usual sigma of an edge, by the blur
  /// beyond a lens's and by what the processing moved. Residuals of exact prints, each about the pose: boundaries 0.03
  /// px in JPEG, 0.09 in H.264, 0.007 in defocus (2 to 3.2 px); their tilts 0.03, 0.08, 0.05; the marker looks shorter
  /// by 0.5 % in defocus. In the dark and in noise nothing is left of it.
  double doubted_of_sigma = 0.8, doubted_length_of_sigma = 0.1;
  /// And by what another renderer than ours leaves of both: px, times the blur's square by the radius.
  double doubted_boundary_of_radius = 0.25;
  double doubted_tilt_of_blur = 0.025, doubted_length_of_blur = 0.001;
  /// And how far a processing that a blurred image can't show moves boundaries.
  double doubted_boundary_of_blur = 0.04;
};
inline constexpr UsualErrors usual_errors;

/// How far one sigma of each number of the rig's camera, and of the marker's length, wrap, gap and diameter, moves
/// measurements [px], to first order. The errors of a print's bands have most in common: they count as one of its
/// length, beside what they leave of each boundary (Marker::boundary_sigma_m()). Images show lengths in diameters, and
/// so a measured print is known: its lengths err with the diameter, beside their own sigmas. Those of another one are
/// known in metres.
class RigErrors {
 public:
  using CameraCovariance = decltype(Camera::covariance)::value_type;
  static constexpr int camera_numbers = CameraCovariance::RowsAtCompileTime, of_marker = 4,
                       most = camera_numbers + 1 + of_marker;  ///< one of the response
  using Shifts = Eigen::Matrix<double, most, 1>;

  /// `by_exponent_px`: how far a boundary moves with the exponent of the camera's response (moved_by_exponent_px()).
  RigErrors(const Camera& camera, const Marker& marker, const ShaftPose& pose,
            const std::array<double, 4>& by_exponent_px);

  /// Zero for numbers without a sigma.
  Shifts of(const Measurement& measurement) const;

 private:
  const Camera* camera_;
  CameraCovariance camera_root_;  ///< of Camera::known_covariance()
  std::array<double, 4> response_px_{};
  /// How far length, wrap, gap and diameter move each boundary: at the print's upper edge, at its lower one.
  std::array<std::array<Eigen::Vector2d, 4>, of_marker> along_m_{};
  Eigen::Vector3d nearer_m_;  ///< by the diameter, in the unrolled frame's axes
};

/// Whether the camera or the marker has sigmas that move measurements alike.
bool has_sigmas(const Camera& camera, const Marker& marker);

/// Errors that all measurements of a group share (one sigma), by how much all noise is larger than each measurement
/// says, and what is uncertain before the print is blamed.
struct CommonErrors {
  ResidualLines lines{};  ///< about which measurements scatter
  std::array<double, measurement_groups> px{};
  /// For all boundaries alike (rms): moved along the shaft, leaning from side to side, bowed.
  double whole_px = 0, leaning_px = 0, bowed_px = 0;
  /// By how much noise is larger than measurements say: of boundaries as they scatter, of sides no less than they say.
  double boundary_noise_scale = 1;
  double noise_scale(const Measurement& m) const {
    return m.group < 4 ? boundary_noise_scale : std::max(1.0, boundary_noise_scale);
  }
  PrintDoubt doubt;
  std::optional<RigErrors> rig;  ///< where the rig has sigmas
};

/// The error of a boundary of this blur as a whole beside a camera's processing, on a shaft of this radius.
double common_boundary_px(double blur_px, double radius_px);

/// By how much `calibrate marker` takes noise larger: compression, motion blur and a camera's processing move edges of
/// this sigma, which were blurred by this and moved by this.
double doubt_scale(double sigma_px, double blur_px, double bias_px);

/// The errors of each boundary and side as a whole, and the noise as it is. `bias_px`, `departure_px`: by how much the
/// camera's processing, corrected where `processed` shows it, and its departure from the rig's may have moved each.
CommonErrors common_errors(const EdgeMeasurements& pass, const EdgeBlur& blur,
                           const std::optional<ProcessedEdges>& processed, const std::array<double, 4>& bias_px,
                           const std::array<double, 4>& departure_px);

}  // namespace lapservo::internal
