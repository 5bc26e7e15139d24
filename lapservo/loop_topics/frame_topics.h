#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/crtk/transport.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// Names of the frames in /tf; NAME in them stands for the instrument's.
struct FrameNames {
  std::string camera = camera_frame, rcm = "NAME_rcm", marker = "NAME_marker", shaft = "NAME_shaft", tip = "NAME_tip";
};

/// Where instruments are. At once, /tf_static has the rig's RCM frames in the camera frame; of every image that shows
/// the instrument, /tf has the marker frame and the shaft frame (origin at the RCM, turned by theta, phi and psi: z
/// along the axis to the tip), /lapservo/NAME/pose the marker's with its covariance, /lapservo/NAME/markers its bands
/// and the shaft from the RCM on as cylinders, and of a tool's tip the frame and /lapservo/NAME/tip_cp, its pose with
/// covariance. Unknown ones are left out.
class FrameTopics {
 public:
  /// `rig`: all its instruments. `rcm_moves`: the RCM frame may move in the camera frame, and is in /tf of every image
  /// of which it is known instead, as what /tf_static has said does not age. The transport must outlive it.
  FrameTopics(Transport& transport, const Rig& rig, const FrameNames& names, bool rcm_moves = false);

  /// The rig's instrument `index` in an image of that stamp; `camera_from_rcm`: that which it was measured with, the
  /// rig's unless the RCM frame moves; nullopt where it is not known.
  void publish(std::size_t index, const Observation& seen, const std::optional<Rigid3>& camera_from_rcm,
               double stamp_s);

  const std::string& camera() const { return names_.camera; }

 private:
  struct Told {
    Instrument instrument;
    FrameNames names;
    Transport::Publisher<PoseMessage> pose, tip;  ///< tip: null without a tool
    Transport::Publisher<CylindersMessage> markers;
  };

  Transport& transport_;
  FrameNames names_;
  bool rcm_moves_;
  Transport::Publisher<TransformsMessage> moving_;
  Transport::Publisher<StaticTransformsMessage> resting_;
  std::vector<Told> told_;
};

/// camera_from_marker of a configuration with its covariance from that of theta, phi, rho, psi.
PoseMessage pose_message(const Instrument& instrument, const Observation::Rcm& seen);
/// The same without camera_from_rcm.
PoseMessage pose_message(const Observation::MarkerPose& seen);

}  // namespace lapservo::internal
