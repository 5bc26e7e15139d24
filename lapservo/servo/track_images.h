#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include <Eigen/Core>

#include "lapservo/rig/rig.h"
#include "lapservo/servo/servo_decision.h"
#include "lapservo/servo/tracked_image.h"
#include "lapservo/stream/endoscope_pose.h"
#include "lapservo/stream/image_stream.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// Tracked images as they come, by whichever thread tracks.
class TrackedImageStream {
 public:
  virtual ~TrackedImageStream() = default;
  /// The newest one since the last call, if any.
  virtual std::optional<TrackedImage> newest() = 0;
  /// Images are tracked with the decision's camera_from_rcm of the first instrument, or without one, as soon as may be;
  /// they carry its number (ImageMeasurement::registration).
  virtual void use(const ServoDecision& by) = 0;
  /// So long before their stamps images were exposed; counts where the endoscope moves.
  void set_delay(double delay_s) { delay_s_ = delay_s; }

 protected:
  std::atomic<double> delay_s_ = 0;
};

/// Tracks a rig's instruments in the images of a stream, which must outlive it. `rcm_px`: see measurement_of(). An
/// exception of the stream or the tracker leaves from newest(). `endoscope`: of one that moves, else null; images
/// whose place it does not know are dropped.
std::unique_ptr<TrackedImageStream> track_images(ImageStream& images, const Rig& rig, const TrackerOptions& options,
                                                 const std::optional<Eigen::Vector2d>& rcm_px, TrackingThread thread,
                                                 const EndoscopePose* endoscope = nullptr);

}  // namespace lapservo::internal
