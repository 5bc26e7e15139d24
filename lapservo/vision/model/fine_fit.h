#pragma once

#include <array>
#include <optional>

#include "lapservo/vision/camera/camera_departure.h"
#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/print_fit.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How a fine fit settles.
struct FineFitLimits {
  /// How far a point may be off beside its noise and still agree with the fit: blood beside a boundary moves it.
  double tolerated_px = 0.037;
  double settled_px = max_only_step_px;  ///< a pass that moves no point farther is the last: one step locates edges
  double settled_blur = 0.1;      ///< change of the blur, a fraction of it, below which edges need not be located again
  double motion_blur_weight = 5;  ///< of its change by that of a point: motion's may be no blur, and never settles
  double settled_oblique_px2 = 0.3;  ///< of a blur's covariance, which moves boundaries by a twentieth of it in px
  double sharp_blur_px = 1.8;        ///< a blur below it may flicker where few sides are left
  double settled_sigmas = 0.01;      ///< a reweighting that moves the unknowns by less is the last
  double other_blur = 0.05;          ///< a change of the mean blur from one frame to the next, a fraction of it
  double well_seen_fraction = 0.7;   ///< of the points: to blame the print or the registration; to see a boundary well
  double least_rcm_sigma_m = 1e-7;   ///< of an exact registration: a hundredth of what images show
};
inline constexpr FineFitLimits fine_fit_limits;

struct FineFit : PrintVerdict, PlacesLookedAt {
  bool converged = false;
  PoseUnknowns unknowns;
  PoseUnknowns as_the_rig_says;  ///< the pose, were the print exactly so
  RowMotion motion;              ///< of which the unknowns hold for the exposure of the marker's middle
  /// Covariance of the unknowns with the registration's numbers (RcmPrior).
  Eigen::Matrix<double, pose_unknowns, 6> with_registration = Eigen::Matrix<double, pose_unknowns, 6>::Zero();
  EdgeBlur blur;
  std::array<int, 4> used{};     ///< of the lines, those on which the boundary was located and agrees with the fit
  int sides_used = 0;            ///< of the stations, those at which the side was located and agrees with the fit
  double inlier_rms_sigmas = 0;  ///< of the boundaries' residuals, print errors taken out, by noise and tolerated_px
  bool asked = false;            ///< what the camera did to the image
  Processing processing = Processing::unknown;  ///< as far as wanted
  int processing_explained = 0;                 ///< how often ProcessingEvidence::explained
  int asked_for_departure = 0;                  ///< how often find_departure() was
  int passes = 0;                               ///< in which edges were located
  std::array<double, 4> bias_px{};              ///< by how much that may have moved each boundary
  CameraDeparture departure;                    ///< from the rig's camera, as far as known

  /// The fraction that was located of the boundary points that the image could show.
  double located_fraction() const;
  /// Mean square of these points' residuals [sigma^2], with the inliers' limit for each that was not located: of two
  /// fits to a frame the better one has less.
  double misfit() const;
  double psi_variance_rad2() const { return covariance(psi_unknown, psi_unknown); }
  /// The same at the frame's time.
  FineFit at_frame() const;
  /// Whether enough of the boundary points are located to blame the print or the registration.
  bool is_well_seen() const { return located_fraction() > fine_fit_limits.well_seen_fraction; }
};

/// Expectations by the frames before. `ask`: whether to look at what the camera did to the image beyond its response
/// (picture_processing.h), which costs a tenth of a tracked frame's time where it did nothing. bias_px, an earlier
/// frame's, is the uncertainty of a frame that can't show it. `departure` is what earlier frames showed of the camera.
/// A frame of another mean blur than that of `blur` is examined in any case: sharpening may have been switched on.
struct Expected {
  bool ask = true;
  std::optional<EdgeBlur> blur = {};
  std::array<double, 4> bias_px{};
  CameraDeparture departure = {};
  std::optional<PoseUnknowns> moved_on = {};  ///< where the marker is if it moves as it did
};

/// Fits the pose to all boundaries on all visible generatrices and to the shaft's sides, located to a fraction of a
/// pixel in linear light, with a robust loss. `start` must be good to some pixels. The result is held at the RCM of the
/// scene's registration, whatever the start is, unless a well seen marker misses it or it lies beyond the marker.
FineFit fit_finely(const Scene& scene, const LightImage& light, const PoseUnknowns& start,
                   const Expected& expected = {});

}  // namespace lapservo::internal
