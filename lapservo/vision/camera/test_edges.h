#pragma once

#include "lapservo/vision/camera/processed_edge.h"

namespace lapservo::internal {

/// For encoded b, g, r as they are before `processing`, which multiplies colour differences to Rec. 601's luma.
inline EdgeVector edge_of(const PictureProcessing& processing, const Eigen::Vector3d& before,
                          const Eigen::Vector3d& after, double offset_px) {
  const auto saturated = [&](const Eigen::Vector3d& bgr) -> Eigen::Vector3d {
    const Eigen::Vector3d grey = Eigen::Vector3d::Constant(Eigen::Vector3d(0.114, 0.587, 0.299).dot(bgr));
    return grey + processing.saturation * (bgr - grey);
  };
  EdgeVector edge;
  edge << offset_px, saturated(before), saturated(after), 0;
  return edge;
}

}  // namespace lapservo::internal
