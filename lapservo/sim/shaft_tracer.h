#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "lapservo/sim/scene.h"

namespace lapservo::internal {

/// The first intersection of a camera ray with a shaft. Bright printed cells are band_0, dark ones band_2. `film_edge`
/// is the face of the film at the marker's two ends.
enum class Part : std::uint8_t { nothing, band_0, band_1, band_2, shaft, film_edge, tip, blood };

constexpr bool is_band(Part part) {
  return part == Part::band_0 || part == Part::band_1 || part == Part::band_2;
}

/// Rays in the camera frame (z = 1) and, after ShaftTracer::trace, what they meet. Columns, for the compiler to
/// vectorise over; a buffer to be used again and again.
struct RayRow {
  std::vector<float> x, y;
  std::vector<Part> part;
  std::vector<float> azimuth_rad;  ///< from the generatrix that faces the camera, right-handed, within +-pi/2
  std::vector<float> along_m;      ///< from the marker's proximal end
  std::vector<float> depth_m;      ///< z in the camera frame

  void resize(std::size_t count);
  std::size_t size() const { return x.size(); }
};

/// Intersects camera rays with one shaft: the film with the print, the thinner shaft on both sides, the tip. Pure
/// geometry. In single precision, whose rounding moves edges by some 1e-4 px.
class ShaftTracer {
 public:
  ShaftTracer(const ShaftModel& model, const ShaftPlacement& placement);

  /// False when the camera is inside the shaft: nothing can be drawn.
  bool visible() const { return visible_; }
  /// Fills what the rays of the row meet; the tip only on request, as few rays come near it.
  void trace(RayRow& rays, bool with_tip) const;

  /// How far a ray passes outside of the surface's silhouette, times a positive scale that hardly changes; negative
  /// inside. `part` chooses the radius: the film's or the shaft's.
  float outside_silhouette(float x, float y, Part part) const;
  /// Distance along the axis beyond boundary e1 (index 1) or e2 (2) at an azimuth from the facing generatrix.
  float beyond_boundary_m(std::size_t index, float azimuth_rad, float along_m) const;
  float tau_rad(float azimuth_rad) const;
  bool has_gap() const { return covered_rad_ < 6.2831853F; }

  // The facing frame: z along the axis, origin at the marker's proximal end, the camera in the x-z plane, x > 0.
  Eigen::Vector3f in_facing_frame(const Eigen::Vector3d& point_in_camera) const;
  const Eigen::Vector3f& camera_in_facing_frame() const { return camera_; }
  Eigen::Vector3f tip_centre() const { return {0, 0, shaft_end_m_}; }
  Eigen::Vector3f point_on_ray(float x, float y, float depth_m) const;
  float radius_m() const { return outer_m_; }
  float shaft_start_m() const { return shaft_start_m_; }
  float shaft_end_m() const { return shaft_end_m_; }
  float length_m() const { return length_m_; }

 private:
  void trace_square(RayRow& rays) const;
  void trace_askew(RayRow& rays) const;
  void trace_tip(RayRow& rays) const;
  void print(RayRow& rays) const;
  void stain(RayRow& rays) const;

  bool visible_;
  Rigid3 facing_from_camera_;
  Eigen::Matrix3f rotation_;
  Eigen::Vector3f camera_;
  float outer_m_, inner_m_, tip_m_;
  float length_m_, shaft_start_m_, shaft_end_m_;
  float tau_facing_;                          // tau on the facing generatrix, in [0, 2 pi)
  std::array<float, 4> at_seam_m_, slope_m_;  // of boundaries e0 to e3: at tau = 0, and per radian
  float covered_rad_;
  bool square_;  // both ends are circles, and the print reaches round
  std::vector<Blotch> blotches_;
  PrintedCells cells_;
};

}  // namespace lapservo::internal
