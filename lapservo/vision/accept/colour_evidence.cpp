#include "lapservo/vision/accept/colour_evidence.h"

#include <algorithm>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

// In the image along the shaft, about where it lies on the marker.
double along_px_per_m(const Scene& scene, const ShaftPose& pose, double azimuth_rad, double along_m) {
  constexpr double step_m = 0.5e-3;
  const auto px = [&](double at_m) {
    return scene.camera.raw_from_point(pose.camera_from_unrolled *
                                       surface_point(scene.marker.radius_m(), azimuth_rad, at_m));
  };
  return (px(along_m + step_m) - px(along_m - step_m)).norm() / (2 * step_m);
}

// Of four neighbours, how many have a pixel's colour.
int neighbours_alike(const Scene& scene, const Eigen::Vector2d& raw_px, std::uint8_t colour) {
  constexpr double apart_px = 1.5;
  int alike = 0;
  for (const double aside : {-apart_px, apart_px}) {
    alike += scene.class_at({raw_px.x() + aside, raw_px.y()}) == colour;
    alike += scene.class_at({raw_px.x(), raw_px.y() + aside}) == colour;
  }
  return alike;
}

double spilled_beyond(const Scene& scene, const ShaftPose& pose, const CylinderView& view, bool distal) {
  constexpr int azimuths = 13, places = 4, least_alike = 2;
  constexpr double reach = 0.8, ring = 0.1;
  const double length_m = scene.marker.length_m();
  const std::uint8_t of_end = scene.bands[distal ? 2 : 0];
  int seen = 0, spilled = 0;
  for (int i = 0; i < azimuths; ++i)
    for (int k = 0; k < places; ++k) {
      const double past_m = ring * length_m * (k + 0.5) / places;
      const Eigen::Vector3d point =
          pose.camera_from_unrolled * surface_point(scene.marker.radius_m(),
                                                    visible_azimuth_rad(view, reach, i, azimuths),
                                                    distal ? length_m + past_m : -past_m);
      const std::uint8_t colour = scene.class_at_point(point);
      if (colour == Scene::outside) continue;
      ++seen;
      spilled += colour == of_end && neighbours_alike(scene, scene.camera.raw_from_point(point), colour) >= least_alike;
    }
  return seen ? static_cast<double>(spilled) / seen : 0;
}

}  // namespace

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double reach = 0.9, beside_px = 4;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const double beside_m = beside_px / along_px_per_m(scene, pose, azimuth_rad, along_m);
    const auto shows_marker = [&](double at_m) {
      return scene.is_ours(
          scene.class_on_shaft(pose.camera_from_unrolled * surface_point(scene.marker.radius_m(), azimuth_rad, at_m)));
    };
    count += (boundary == 0 || shows_marker(along_m - beside_m)) && (boundary == 3 || shows_marker(along_m + beside_m));
  }
  return count;
}

double spilled_in_patches(const Scene& scene, const ShaftPose& pose) {
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  return std::max(spilled_beyond(scene, pose, *view, false), spilled_beyond(scene, pose, *view, true));
}

}  // namespace lapservo::internal
