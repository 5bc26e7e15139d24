#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/check/arm_check.h"
#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/check/rig_evidence.h"
#include "lapservo/calibration/colour/hue_faults.h"
#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// From when on a rig is not good enough. One number each, below which the loop's own errors (docs/notes/accuracy.md)
/// or its limits are larger.
struct RigLimits {
  double found = 0.95;                       ///< fraction of the frames
  double dark_value = 70, dark_chroma = 45;  ///< of 255
  double clipped = 0.1;                      ///< fraction of the pixels
  double hue_deg = 12;                       ///< between a band and the rig's hue
  double response_px = 0.05;                 ///< between edges of channels that rise and fall at one place
  double print_rad = 5e-3;                   ///< rms of psi, by a print that is not the rig's
  double focal = 5e-3;                       ///< relative
  double drift_m = 1e-3, drift_rad = 5e-3;
  double delay_s = 15e-3;
  double noise = 3;  ///< times what the images' noise leaves between joints and images
  double place_m = 1e-3, axis_rad = 7e-3, roll_rad = 10e-3;  ///< by the registration
  double width_px = 40;                                      ///< of the shaft
  double sigma_rad = 5e-3;                                   ///< of psi over the work space
  double work_space = 0.9;                                   ///< fraction of it that has to keep sigma_rad
};
inline constexpr RigLimits rig_limits;

/// The check of a print by a recording. Empty refusal: all of it is valid.
struct PrintCheck {
  std::string refusal;
  std::string contradiction;             ///< why the frames are not those of one print; empty where they are
  double before_px = 0, after_px = 0;    ///< boundaries about the rig's print, and about the one that fits best
  Told psi_rad;                          ///< rms over the turn of what the rig's print makes of psi
  std::vector<PrintResidual> residuals;  ///< about the rig's print
};
PrintCheck check_print(const Rig& rig, std::size_t instrument, std::vector<KeyFrame> frames);

/// The RCM of a registered rig by the image alone, for recordings without joints.
struct RcmCheck {
  std::string refusal;
  Told distance_m;                                  ///< of the rig's RCM from it
  Told drift_m;                                     ///< between the recording's halves
  std::vector<std::pair<double, double>> misses_m;  ///< time, by how much the axis misses it
};
/// The instrument has camera_from_rcm.
RcmCheck check_rcm(const Instrument& instrument, const std::vector<TimedPose>& poses);

/// One standard deviation of the roll about the shaft, over the image at one depth.
struct SigmaMap {
  static constexpr int columns = 7, rows = 5;
  double depth_m = 0;  ///< of the marker's middle
  static constexpr std::size_t cells = static_cast<std::size_t>(columns) * rows;
  /// By row, the median over three rotations, of which one that is not found counts as the largest; empty where the
  /// marker is not wholly in view or is not found.
  std::array<std::optional<double>, cells> sigma_rad{};
  /// Where it is in view, but at most of the rotations not found.
  std::array<bool, cells> lost{};
};

/// Sigma of psi that the rig has over its work space.
struct WorkSpace {
  std::vector<SigmaMap> maps{};    ///< at the near and the far end of where the marker was
  double good = 1, worst_rad = 0;  ///< fraction with at most RigLimits::sigma_rad
  int places = 0, lost = 0;        ///< looked at; of them, not good, those where the marker is not found
};

/// Everything that was found out of one instrument of a rig.
struct RigFindings {
  std::size_t frames = 0;
  int found = 0, mismatched = 0;  ///< frames
  std::string cause;              ///< of frames in which it is not found: FrameDiagnosis::cause()
  Status failure = Status::ok;    ///< the most frequent of those that are not ok, if any
  PictureLight picture;
  std::optional<MarkerLight> light;  ///< medians; empty when no frame shows the marker
  double hue_error_deg = 0;          ///< the largest of the three bands'
  std::vector<HueFault> hue_faults;
  double width_px = 0;  ///< median
  std::optional<MarkerResponse::Result> response;
  bool lossy = false;              ///< the recording: compression moves the edges of channels, too
  bool response_measured = false;  ///< by `calibrate camera`: `calibrate colour` alone would keep it
  std::optional<PrintCheck> print;
  std::optional<ArmCheck> arm;  ///< with joints
  std::optional<RcmCheck> rcm;  ///< without, of a registered rig
  bool registered = false;      ///< the rig has camera_from_rcm
  MissedRcm missed_rcm;         ///< of a registered rig: frames that are ok, and without q
  bool has_joints = false;      ///< of the recording
  std::optional<WorkSpace> work_space;
};

/// Measurements from the frames; the optional parts are the caller's to add.
RigFindings findings_of(const Rig& rig, std::size_t instrument, const RigEvidence& evidence);

/// One thing to do.
struct Advice {
  bool needed;          ///< else the rig is good enough without
  std::string what;     ///< what is wrong, with its size
  std::string command;  ///< what helps
  std::string gain;     ///< what it would gain
};

/// Remedies in the order of their dependence (light, colours, encoding, camera, print, joints' motion, delay,
/// registration, the view), necessary ones before possible ones.
std::vector<Advice> advice_on(const RigFindings& findings);

}  // namespace lapservo::internal
