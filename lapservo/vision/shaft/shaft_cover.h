#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// An instrument that was found, for those who look for another one behind or beside it: its marker and the shaft on
/// both sides, with some pixels of margin. Borrows the camera and the marker.
class ShaftCover {
 public:
  /// `bands`: the colour classes of the marker's bands.
  ShaftCover(const Camera& camera, const Marker& marker, const std::array<std::uint8_t, 3>& bands,
             const ShaftPose& pose);

  /// Whether a pixel of this colour class shows the marker, as far as colours show.
  bool explains(const Eigen::Vector2d& raw_px, std::uint8_t colour) const;
  /// Whether the shaft lies before a point in the camera's frame.
  bool hides(const Eigen::Vector3d& point) const;
  /// Whether the shaft may lie before another marker in the image or touch it, where both may be some pixels beside.
  bool may_meet(const Marker& marker, const ShaftPose& pose) const;
  /// Whether the shaft is nearer to the camera than some of another marker.
  bool lies_before(const Marker& marker, const ShaftPose& pose) const;
  /// Whether a blob shows colours of these bands under or beside the shaft that the marker does not explain.
  bool lies_beside(const Blob& blob, const std::array<std::uint8_t, 3>& bands) const;

 private:
  // Where a line of sight passes the shaft's axis nearest.
  struct Passage {
    Eigen::Vector3d way;                                 // of the line, in the unrolled frame; 1 m of depth long
    double across;                                       // its part across the axis
    double along_m, apart_m;                             // where on the axis, and how far from it
    double depth_m, m_per_px;                            // there; negative behind the camera
    double sine() const { return across / way.norm(); }  // of the angle between both: a leaning shaft looks shorter
  };
  Passage passage(const Eigen::Vector3d& ray) const;
  bool is_shaft(const Passage& at, double margin_px) const;

  const Camera* camera_;
  const Marker* marker_;
  std::array<std::uint8_t, 3> bands_;
  double psi_rad_;
  Eigen::Matrix3d unrolled_from_camera_;
  Eigen::Vector3d eye_;  // the camera, in the unrolled frame
};

/// Whether one of them explains() a pixel of this colour class; and whether one hides() a point. Not inline: they are
/// needed seldom, and what looks at every pixel of a line is short without them.
bool explained_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, std::uint8_t colour);
bool hidden_by(std::span<const ShaftCover* const> others, const Eigen::Vector3d& point);

/// The parts of them that the instruments that are known to be in the image leave, largest first. The parts of one that
/// lies behind another stay together.
std::vector<Blob> without(const std::vector<Blob>& blobs, std::span<const ShaftCover* const> others);

}  // namespace lapservo::internal
