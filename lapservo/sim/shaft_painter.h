#pragma once

#include <array>
#include <cstddef>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/outline.h"
#include "lapservo/sim/shaft_lighting.h"
#include "lapservo/sim/shaft_tracer.h"

namespace lapservo::internal {

/// The part of a pixel where a function is negative.
struct PixelCoverage {
  float fraction = 0;                ///< of the pixel's area
  float centre_x = 0, centre_y = 0;  ///< centroid, from the pixel's first corner, in [0, 1]; the middle when empty
};

/// From the function's values at the corners (0,0), (1,0), (1,1), (0,1), linear along the pixel's sides: exact for
/// straight edges.
inline PixelCoverage negative_part(const std::array<float, 4>& f) {
  constexpr std::array<std::array<float, 2>, 4> corner{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  std::array<std::array<float, 2>, 8> polygon{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t j = (i + 1) % 4;
    if (f[i] < 0) polygon[n++] = corner[i];
    if ((f[i] < 0) != (f[j] < 0)) {
      const float t = f[i] / (f[i] - f[j]);
      polygon[n++] = {corner[i][0] + t * (corner[j][0] - corner[i][0]),
                      corner[i][1] + t * (corner[j][1] - corner[i][1])};
    }
  }
  float twice_area = 0, x = 0, y = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto &p = polygon[i], &q = polygon[(i + 1) % n];
    const float cross = p[0] * q[1] - q[0] * p[1];
    twice_area += cross;
    x += cross * (p[0] + q[0]);
    y += cross * (p[1] + q[1]);
  }
  if (!(twice_area > 1e-6F)) return {0, 0.5F, 0.5F};
  return {0.5F * twice_area, x / (3 * twice_area), y / (3 * twice_area)};
}

/// Places within a pixel, a rank-1 lattice: each has a row and a column of its own, so edges along the axes are as fine
/// as any.
constexpr std::array<std::array<float, 2>, 32> make_sample_lattice() {
  std::array<std::array<float, 2>, 32> lattice{};
  for (std::size_t i = 0; i < lattice.size(); ++i)
    lattice[i] = {(static_cast<float>(i) + 0.5F) / lattice.size(),
                  (static_cast<float>((i * 19 + 7) % lattice.size()) + 0.5F) / lattice.size()};
  return lattice;
}
inline constexpr auto sample_lattice = make_sample_lattice();

/// Between a function's values at the corners (0,0), (1,0), (1,1), (0,1).
inline float within(const std::array<float, 4>& corner, float u, float v) {
  const float top = corner[0] + u * (corner[1] - corner[0]), bottom = corner[3] + u * (corner[2] - corner[3]);
  return top + v * (bottom - top);
}

/// Rays (z = 1) through the corners of raw pixels.
class PixelRays {
 public:
  explicit PixelRays(const Camera& camera);
  /// Rays through the upper left corners of pixels (begin, v) to (begin + rays.size() - 1, v).
  void fill(RayRow& rays, int begin, int v) const;

 private:
  Camera camera_;
  cv::Mat x_, y_;  // of a distorted camera, (height + 1) x (width + 1)
};

/// Light that gathers in front of a background. `depth_m` and `cover` say for each pixel how near the nearest thing
/// drawn so far is and what fraction of the pixel is covered; empty when there is only one shaft.
struct SceneLight {
  cv::Mat light, depth_m, cover;
};

/// The light that a pixel receives from one thing, weighted with the fraction of the pixel that it covers.
struct Paint {
  Light light = Light::Zero();
  float cover = 0;
};

/// Puts it into a pixel of a SceneLight, in front of what is there or behind; `background`: the pixel without anything.
void blend(const Paint& paint, float depth_m, const cv::Vec3f& background, cv::Vec3f& pixel, float& nearest_m,
           float& cover);

/// Paints one shaft in one pose.
class ShaftPainter {
 public:
  /// `tip`: a circle around the image of its tip.
  ShaftPainter(const ShaftModel& model, const ShaftPlacement& placement, const Lighting& lighting, const Disc& tip);

  /// Paints pixels of `part` over what the scene holds; `behind` is the background alone.
  void paint(const PixelRays& rays, const cv::Rect& part, const cv::Mat& behind, SceneLight& scene);

 private:
  /// The four corners of a pixel: (0,0), (1,0), (1,1), (0,1).
  struct Corners {
    std::array<Part, 4> part;
    std::array<float, 4> x, y, azimuth_rad, along_m, depth_m;
  };

  static Corners corners(const RayRow& above, const RayRow& below, std::size_t i);
  Paint paint_pixel(const Corners& corners);
  bool spans_seam(const Corners& corners) const;
  Paint inside(const Corners& corners);
  bool silhouette(const Corners& corners, Part inner, Paint& paint);
  bool boundary(const Corners& corners, Part proximal, Part distal, Paint& paint);
  Paint sampled(const Corners& corners);
  Paint of_side(Part part, float azimuth_rad, float along_m);
  Lit lit_at(Part part, float x, float y, float depth_m) const;
  const Light& reflectance(Part part, float along_m) const;

  ShaftTracer tracer_;
  ShaftLighting lighting_;
  std::array<Light, 8> reflectances_;
  Disc tip_;
  RayRow above_, below_, samples_, single_;
};

}  // namespace lapservo::internal
