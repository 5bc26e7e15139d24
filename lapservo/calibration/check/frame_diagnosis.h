#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/calibration/colour/marker_light.h"
#include "lapservo/core/spread.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/status.h"

namespace lapservo::internal {

/// Why frames have this status, other than ok, and what helps, as docs/statuses.md has it: "CAUSE; REMEDY" without a
/// full stop.
const char* usual_cause(Status status);

/// Whether compression refuses frames by this status.
constexpr bool comes_by_compression(Status status) {
  return status == Status::poor_fit || status == Status::uncertain || status == Status::ambiguous;
}

/// One line, without a full stop, on the first hue of a marker whose class reaches those of tissue, which then joins
/// the band: value, effect and hues to choose. Empty where there is none.
std::string tissue_hue_text(const Marker& marker);

/// Tolerance with which a print that is not calibrated yet is looked for: it is not to hide the marker.
inline constexpr double uncalibrated_tolerance_m = 0.15e-3;

/// Frames that show an instrument, and those of them whose shaft misses the rig's RCM.
struct MissedRcm {
  int shown = 0;                 ///< frames that show it
  std::vector<double> misses_m;  ///< distances of the shaft's axis from the RCM, where it misses it
  int reversed = 0;              ///< of them, those whose marker points back to the RCM

  void add_missed(const Observation::MarkerPose& marker, const Eigen::Vector3d& rcm_m);
  /// Whether the rig's RCM is wrong: more than half of the frames miss it, and at least five.
  bool is_wrong() const;
  /// Whether it is the marker that is wrong.
  bool is_reversed() const { return 2 * static_cast<std::size_t>(reversed) > misses_m.size(); }
  std::string text() const;  ///< "in N of M frames ..."
};

/// Why frames of a recording are damaged, show no instrument of a rig, or an instrument that misses the rig's RCM.
/// Frames are added as they are tracked; a few of those without a result are kept and read otherwise when text() or
/// cause() is called.
class FrameDiagnosis {
 public:
  /// `deinterlaced`: one field of each frame is tracked.
  explicit FrameDiagnosis(const Rig& rig, bool deinterlaced = false) : rig_(rig), deinterlaced_(deinterlaced) {}

  /// A frame, 8-bit BGR of the rig's size, and what the tracker returns for it; nothing where no instrument is found.
  void add(const cv::Mat& bgr, const std::vector<Observation>& observations);

  /// One line that names the most probable cause and its remedy, without a full stop; empty where at least half of the
  /// frames show an instrument, and at least half of those give q, or features where the rig has no camera_from_rcm,
  /// unless the bands' hues move where an instrument is lost in some.
  /// `lossy`: the recording is compressed.
  std::string text(bool lossy = false) const;

  /// To append to a refusal: "; " and the cause where frames without an instrument show one, else nothing.
  std::string cause() const;

  /// To append to usual_cause(Status::no_marker): "; or " and the background with its remedy, where in most frames the
  /// class of one of the instrument's bands covers more than a marker in view can; else nothing.
  std::string background(std::size_t instrument) const;

 private:
  struct Seen {
    std::map<Status, int> refused;
    MissedRcm missed;                               ///< where q is missing
    Spread<std::optional<MarkerLight>> lights{48};  ///< where it is found
  };
  void keep(const cv::Mat& bgr);
  std::string cause_in_frames() const;
  std::string text_of_refusals(bool lossy) const;
  std::string text_of_missed_rcm() const;
  std::string text_of_moving_hues() const;

  Rig rig_;
  bool deinterlaced_;
  int frames_ = 0, without_instrument_ = 0, interlaced_ = 0, blended_ = 0, damaged_ = 0;
  std::map<std::string, Seen> seen_;
  std::vector<cv::Mat> kept_;
  cv::Mat shown_;           ///< the first frame with a result
  int without_result_ = 0;  ///< frames, some of which may show an instrument that misses the rig's RCM
};

}  // namespace lapservo::internal
