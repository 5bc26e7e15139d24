#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/sim/scene.h"

namespace lapservo::bench {

/// A square tag's cells, its dark border included, a row after the other; 1 is dark.
struct TagCells {
  int size = 0;  ///< cells a side
  std::vector<std::uint8_t> dark;
};

/// Tags wrapped round a shaft, in rings that are turned by half a tag against one another, as many along the film as
/// fit with cells that are square to a tenth or so. Every tag has another number.
class TagBundle {
 public:
  /// `around`: tags in a ring.
  TagBundle(const Marker& film, const std::vector<TagCells>& tags, int around);

  /// The print on the film.
  const PrintedCells& print() const { return print_; }
  std::size_t size() const { return corners_.size(); }
  /// Corners of a tag's dark border, in the marker's frame (z along the axis from the proximal end, x towards tau = 0),
  /// in the order of the print's (row, column): (0, 0), (0, n), (n, n), (n, 0).
  const std::array<Eigen::Vector3d, 4>& corners_m(std::size_t tag) const { return corners_[tag]; }
  /// A point of the same border, `part` (0 to 1) of the way along the film from a corner to the next one.
  Eigen::Vector3d side_m(std::size_t tag, std::size_t corner, double part) const;

 private:
  Eigen::Vector3d place_m(double row, double column) const;

  struct Place {
    int row, column;  // of the first cell
  };
  double radius_m_, length_m_;
  int tag_size_;
  PrintedCells print_;
  std::vector<Place> places_;
  std::vector<std::array<Eigen::Vector3d, 4>> corners_;
};

/// A tag as a detector found it: its corners in ideal pixels, in the order of TagBundle::corners_m().
struct FoundTag {
  std::size_t tag;
  std::array<Eigen::Vector2d, 4> ideal_px;
};

/// The place that a detector reports as a tag's corner: the corner itself, or the intersection of straight lines along
/// its sides, which differs on a shaft, as two of them are bent.
enum class CornersBy { themselves, straight_sides };

/// camera_from_marker by all corners of all tags, least squares with a Cauchy loss. Nullopt when there is none.
std::optional<Rigid3> bundle_pose(const TagBundle& bundle, const std::vector<FoundTag>& found, const Camera& camera,
                                  CornersBy corners);

}  // namespace lapservo::bench
