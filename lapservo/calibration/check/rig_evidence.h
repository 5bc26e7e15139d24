#pragma once

#include <cstddef>
#include <deque>
#include <future>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/check/arm_check.h"
#include "lapservo/calibration/colour/marker_light.h"
#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/core/workers.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// One frame, as the rig sees its marker.
struct FrameEvidence {
  double time_s;
  Status status;
  double sigma_roll_rad = 0;                        ///< when ok: about the axis, in a fit as it is tracked
  std::optional<Observation::MarkerPose> marker{};  ///< when ok
  std::optional<double> psi_rad{};                  ///< when ok and the rig has camera_from_rcm
  std::optional<MarkerLight> light;                 ///< where the marker was found, be its print the rig's or not
  double width_px = 0;                              ///< of the shaft, there
};

/// Passes a recording's frames through all measurements that test the rig.
class RigEvidence {
 public:
  /// How many cores frames are looked at with; both find the same.
  enum class Cores { one, two };
  RigEvidence(const Rig& rig, std::size_t instrument, Cores cores = Cores::two);

  /// 8-bit BGR of the rig's size, whose pixels stay as they are: the second core may look at them some frames later.
  /// Then it also throws what was wrong with one before. Returns whether the marker was found by the image alone.
  bool add(const cv::Mat& bgr, double time_s);

  // These functions wait for all frames that were added.
  const std::vector<FrameEvidence>& frames() const { return finish_all_but(0), frames_; }
  /// By the image alone, whatever the print; with TimedPose::by_focal. Their sigmas are each frame's own: the rig's
  /// sigmas, which all frames share, are not in them.
  const std::vector<TimedPose>& poses() const { return finish_all_but(0), poses_; }
  std::vector<TrackedPsi> tracked_psi() const;
  /// Nullopt when the marker's edges are too few.
  std::optional<MarkerResponse::Result> response() const { return finish_all_but(0), response_.result(); }
  PictureLight picture() const;  ///< medians
  int count(Status status) const;
  /// Empties what it takes.
  std::vector<KeyFrame> take_key_frames() { return finish_all_but(0), key_frames_.take(); }

 private:
  static constexpr double focal_step = 0.01;
  // By the image alone and without the rig's sigmas, with the rig's focal length, with one that is longer and with one
  // that is shorter.
  struct FreeTrackers {
    FreeTrackers(const Rig& rig, double tolerance_m);
    Tracker at, longer, shorter;
  };
  // A frame that the second core may not have looked at yet, and what these have of it.
  struct Unfinished {
    std::future<FrameEvidence> as_it_is;
    std::optional<MarkerLight> light;
    double width_px = 0;
  };
  // Whether the marker was found.
  bool look_with(FreeTrackers& trackers, const cv::Mat& bgr, double time_s, Unfinished& frame);
  void look_at_light(const cv::Mat& bgr, const Observation& seen, Unfinished& frame);
  void finish_all_but(std::size_t unfinished) const;

  Rig rig_;
  std::size_t instrument_;
  Tracker as_it_is_;
  FreeTrackers exact_, tolerant_;
  KeyFrames key_frames_;
  MarkerResponse response_;
  std::vector<TimedPose> poses_;
  std::vector<PictureLight> pictures_;
  // When they are finished changes nothing that can be seen.
  mutable std::vector<FrameEvidence> frames_;
  mutable std::deque<Unfinished> unfinished_;
  Workers worker_;  // the last to come and the first to go: it uses the trackers
};

}  // namespace lapservo::internal
