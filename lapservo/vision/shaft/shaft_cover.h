#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Where in the image an instrument lies that was found: its marker and the shaft on both sides, with some pixels of
/// margin. For those who look for another instrument there. In cells of cell_px pixels.
class ShaftCover {
 public:
  static constexpr int cell_px = 4;

  /// Makes room for an instrument in a camera's image, since frames that are tracked allocate nothing.
  void reserve(const Camera& camera);

  /// `bands`: the colour classes of the marker's bands.
  void draw(const Camera& camera, const Marker& marker, const std::array<std::uint8_t, 3>& bands,
            const ShaftPose& pose);
  void clear() { drawn_ = false; }
  bool drawn() const { return drawn_; }

  /// Whether a pixel of this colour class shows the marker, as far as colours show.
  bool explains(double u_px, double v_px, std::uint8_t colour) const {
    const auto cell = index(u_px, v_px);
    return cell && (cells_[*cell].colours & bit(colour)) != 0;
  }
  /// Whether the shaft lies before what is seen there at this depth (z in the camera's frame).
  bool hides(double u_px, double v_px, double depth_m) const {
    const auto cell = index(u_px, v_px);
    return cell && cells_[*cell].axis_depth_m > 0 && cells_[*cell].axis_depth_m < depth_m;
  }

 private:
  struct Cell {
    float axis_depth_m = 0;     // 0: not covered
    std::uint32_t colours = 0;  // a bit for each class that may show
  };
  // The shaft at one place along it.
  struct Section {
    double along_m, px_per_m, axis_depth_m;
    Eigen::Vector2d left_px, right_px;  // some pixels beyond the silhouettes
    Eigen::Vector2d bulge_px;           // from the middle between them to what faces the camera: the shaft leans
  };
  static constexpr std::size_t lines = 24;
  using EndsOfLines = std::array<std::array<double, 4>, lines>;  // where each visible line crosses the boundaries [m]
  static constexpr std::uint32_t bit(std::uint8_t colour) { return colour < 8 * sizeof(1U) ? 1U << colour : 0; }

  std::optional<std::size_t> index(double u_px, double v_px) const {
    const auto within = [](double px, int first, int count) {
      return px >= first * cell_px && px < (first + count) * cell_px;
    };
    if (!within(u_px, left_, columns_) || !within(v_px, top_, rows_)) return std::nullopt;
    const int column = static_cast<int>(u_px) / cell_px - left_, row = static_cast<int>(v_px) / cell_px - top_;
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }
  void frame(const Camera& camera);
  void fill(const Section& section, const Marker& marker, const EndsOfLines& ends_m,
            const std::array<std::uint8_t, 3>& bands);

  bool drawn_ = false;
  int left_ = 0, top_ = 0, columns_ = 0, rows_ = 0;  // in cells
  std::vector<Cell> cells_;
  std::vector<Section> sections_;
};

/// Whether another's shaft may lie before a marker in the image or touch it, where both may be some pixels beside.
bool may_meet(const Camera& camera, const Marker& marker, const ShaftPose& pose, const Marker& others_marker,
              const ShaftPose& other);

/// Whether another's shaft is nearer to the camera than some of a marker, where it is nearest to that.
bool lies_before(const ShaftPose& other, const Marker& marker, const ShaftPose& pose);

/// Whether a blob shows colours of these bands under or beside another's shaft that its marker does not explain.
bool lies_beside(const Camera& camera, const Marker& others_marker, const ShaftPose& other, const Blob& blob,
                 const std::array<std::uint8_t, 3>& bands);

/// Whether one of them explains() a pixel of this colour class; and whether one hides() what is seen there at this
/// depth. Not inline: they are needed seldom, and what looks at every pixel of a line is short without them.
bool explained_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, std::uint8_t colour);
bool hidden_by(std::span<const ShaftCover* const> others, const Eigen::Vector2d& raw_px, double depth_m);

/// The parts of them that the instruments that are known to be in the image leave, largest first. The parts of one that
/// lies behind another stay together.
std::vector<Blob> without(const std::vector<Blob>& blobs, std::span<const ShaftCover* const> others);

}  // namespace lapservo::internal
