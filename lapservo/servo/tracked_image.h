#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/image_measurement.h"
#include "lapservo/rig/rig.h"
#include "lapservo/stream/image_stream.h"
#include "lapservo/vision/tracker.h"

namespace lapservo {

/// An image and what was seen in it.
struct TrackedImage {
  StampedImage image;
  std::vector<Observation> observations;  ///< one an instrument of the rig
  ImageMeasurement measurement;           ///< of the rig's first instrument
};

/// Tracked images as they come, by whichever thread tracks.
class TrackedImageStream {
 public:
  virtual ~TrackedImageStream() = default;
  /// The newest one since the last call, if any.
  virtual std::optional<TrackedImage> newest() = 0;
};

enum class TrackingThread {
  callers,  ///< newest() tracks: what a simulation wants, in which no time passes meanwhile
  own,      ///< newest() never waits for vision: what a real arm wants
};

/// Tracks a rig's instruments in the images of a stream, which must outlive it. `rcm_px`: the RCM's image
/// where the rig has no camera_from_rcm. An
/// exception of the stream or the tracker leaves from newest().
std::unique_ptr<TrackedImageStream> track_images(ImageStream& images, const Rig& rig, const TrackerOptions& options,
                                                 const std::optional<Eigen::Vector2d>& rcm_px, TrackingThread thread);

}  // namespace lapservo
