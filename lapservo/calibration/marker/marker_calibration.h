#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/marker/marker_survey.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// A frame that the calibration measures in.
struct KeyFrame {
  MarkerView view;
  Sighting sighting;
  double time_s = 0;
  double turned_rad = 0;  ///< about the axis since the frame before, as psi counts; 0 where that is not known
};

/// Chooses, out of all frames of a turn, some from all sides of the marker.
class KeyFrames {
 public:
  KeyFrames(const Rig& rig, std::size_t instrument);

  /// 8-bit BGR of the rig's size. Returns whether the marker was found.
  bool add(const cv::Mat& bgr, double time_s);
  int found() const { return found_; }
  /// Those chosen, in no order; empties this.
  std::vector<KeyFrame> take();

 private:
  Rig rig_;
  std::size_t instrument_;
  MarkerSurvey survey_;
  std::vector<std::vector<KeyFrame>> sectors_;  // by the azimuth that faces the camera, for either way of the turn
  std::optional<double> last_tau_rad_;
  int found_ = 0;
};

/// A boundary's residual at one place of the print, along the shaft.
struct PrintResidual {
  std::size_t boundary;
  double tau_rad, residual_m;
};

struct MarkerCalibration {
  /// Why there is none, and what to do about it: then `contradicts` alone counts. Empty when there is one.
  std::string refusal;
  bool contradicts = false;    ///< the frames are not those of one print: more of them do not help
  Marker marker;               ///< with its sigmas; tolerance_m is what they leave
  std::size_t frames = 0;      ///< that were used
  std::size_t seam_views = 0;  ///< of them, those that show the seam
  /// Compressed images of a rotation in one direction: the seam may lag in all of them. A rotation there and back would
  /// show it.
  bool seam_may_lag = false;
  /// Residuals of the boundaries' points about a fit of the poses, for the rig's print and for the calibrated one: rms
  /// of the points that are inliers of the latter.
  double before_px = 0, after_px = 0;
  std::vector<std::string> faults;    ///< of the print, that show beyond the noise: the sigmas count them
  std::vector<PrintResidual> before;  ///< for the rig's print
  std::vector<KeyFrame> key_frames;   ///< those used, where the calibrated marker has them
  int found = 0;                      ///< frames of a recording with the marker in it
  FramesRead read;                    ///< of measure_marker()
};

/// Bands, wrap, skew and gap of the rig's marker from frames of a full rotation. The diameter stays: images give
/// lengths in diameters, since a smaller shaft nearer by looks the same.
MarkerCalibration calibrate_marker(const Rig& rig, std::size_t instrument, std::vector<KeyFrame> frames,
                                   const JobWatch& watch = {});

}  // namespace lapservo::internal
