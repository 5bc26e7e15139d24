#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/vision/colour/blob_search.h"

namespace lapservo::internal {

/// Goes from blob to blob of a frame and, where its time ends first, on in the frames to come. Their blobs come in
/// another order, so those that were looked at are known by their place, which moves with them.
class BlobWalk {
 public:
  bool done = false;         ///< none is left
  bool other_bands = false;  ///< Starts, of those that were looked at

  /// Those of this frame's blobs that were not looked at yet: first the one in which it stopped, then the largest.
  /// `reach_px`: no blob moves farther from frame to frame.
  std::vector<const Blob*> rest(const std::vector<Blob>& blobs, double reach_px);

  /// Which start of the first of the rest is next. For the others it is the first.
  std::size_t start() const { return start_; }

  void stop(const Blob& blob, std::size_t next_start);
  void finish(const Blob& blob);

  bool stopped() const { return stopped_in_px_.has_value(); }
  /// Whether it has looked at anything.
  bool begun() const { return stopped() || !looked_at_px_.empty(); }

 private:
  std::vector<Eigen::Vector2d> looked_at_px_;
  std::optional<Eigen::Vector2d> stopped_in_px_;
  std::size_t start_ = 0;
};

}  // namespace lapservo::internal
