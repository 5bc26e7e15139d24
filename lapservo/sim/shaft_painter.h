#pragma once

#include <array>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/outline.h"
#include "lapservo/sim/pixel_coverage.h"
#include "lapservo/sim/shaft_lighting.h"
#include "lapservo/sim/shaft_tracer.h"

namespace lapservo::internal {

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
