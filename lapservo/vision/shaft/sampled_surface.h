#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Places along a line in the camera's frame and their pixels: the k-th is base + (k + 0.5) * step [m]. All are
/// projected at once, in vectors: half of what a search for hidden markers costs is this.
template <std::size_t Count>
class LineInImage {
 public:
  LineInImage(const Scene& scene, const Eigen::Vector3d& base, const Eigen::Vector3d& step)
      : scene_(scene), base_(base), step_(step) {
    const Camera& camera = scene.camera;
    for (std::size_t k = 0; k < Count; ++k) {
      const double steps = static_cast<double>(k) + 0.5;
      const double inverse_z = 1 / (depth_m_[k] = base.z() + steps * step.z());
      u_px_[k] = camera.cx_px + camera.fx_px * (base.x() + steps * step.x()) * inverse_z;
      v_px_[k] = camera.cy_px + camera.fy_px * (base.y() + steps * step.y()) * inverse_z;
    }
    if (!camera.distorted()) return;
    for (std::size_t k = 0; k < Count; ++k) {
      if (!scene.field.contains(point(k))) depth_m_[k] = 0;
      const Eigen::Vector2d raw_px = camera.raw_from_ideal({u_px_[k], v_px_[k]});
      u_px_[k] = raw_px.x(), v_px_[k] = raw_px.y();
    }
  }

  /// Nullptr where the image says nothing of it: beyond its border, where another instrument hides it or, beside the
  /// shaft, where another one's marker shows.
  const std::uint8_t* pixel(std::size_t k, bool on_shaft) const {
    const Eigen::Vector2d raw_px(u_px_[k], v_px_[k]);
    const std::uint8_t* const bgr = depth_m_[k] > LensField::nearest_m ? scene_.pixel_at(raw_px) : nullptr;
    if (!bgr || scene_.others.empty()) return bgr;
    const bool is_others = !on_shaft && scene_.class_beside(raw_px) == Scene::outside;
    return is_others || scene_.hidden(point(k)) ? nullptr : bgr;
  }
  /// Colour class of the shaft there, Scene::outside where the image says nothing of it.
  std::uint8_t class_on_shaft(std::size_t k) const {
    const std::uint8_t* const bgr = pixel(k, true);
    return bgr ? scene_.classes(bgr) : Scene::outside;
  }

 private:
  Eigen::Vector3d point(std::size_t k) const { return base_ + (static_cast<double>(k) + 0.5) * step_; }

  const Scene& scene_;
  Eigen::Vector3d base_, step_;
  std::array<double, Count> u_px_, v_px_, depth_m_;
};

/// Lines side by side along a shaft, on which what it shows is looked at; and at how many places of each, beyond the
/// marker's ends as well, colours show how well a pose agrees with them.
inline constexpr int surface_lines = 13, surface_places = 48;

/// Colour classes along lines of a shaft's visible surface.
template <std::size_t Samples>
struct SampledSurface {
  /// Fraction of the visible half angle that the lines cover: beyond, bands are too foreshortened and dark.
  static constexpr double reach = 0.74;
  struct Line {
    double azimuth_rad;
    std::array<std::uint8_t, Samples> classes;  ///< Scene::outside where the image says nothing of the shaft
  };

  /// From `beyond_m` before the marker's proximal end to as far behind its distal one.
  SampledSurface(const Scene& scene, const ShaftPose& pose, const CylinderView& view, double beyond_m)
      : first_m(-beyond_m), step_m((scene.marker.length_m() + 2 * beyond_m) / Samples) {
    const Eigen::Vector3d step = pose.camera_from_unrolled.rotation * Eigen::Vector3d(0, 0, step_m);
    for (int i = 0; i < surface_lines; ++i) {
      Line& line = lines[static_cast<std::size_t>(i)];
      line.azimuth_rad = visible_azimuth_rad(view, reach, i, surface_lines);
      const LineInImage<Samples> places(scene, point_on(pose, scene.marker, line.azimuth_rad, first_m), step);
      for (std::size_t k = 0; k < Samples; ++k) line.classes[k] = places.class_on_shaft(k);
    }
  }

  /// The distance of a sample from the proximal end, and how many samples, with a fraction, lie before a distance.
  double along_m(std::size_t sample) const { return first_m + (static_cast<double>(sample) + 0.5) * step_m; }
  double samples_before(double along_m) const { return (along_m - first_m) / step_m; }

  double first_m, step_m;
  std::array<Line, surface_lines> lines;
};

}  // namespace lapservo::internal
