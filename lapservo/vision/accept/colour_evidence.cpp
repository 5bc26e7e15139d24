#include "lapservo/vision/accept/colour_evidence.h"

#include <algorithm>
#include <array>

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

// On how many of so many lines along the marker it holds; `holds` is given what tells the colour class so many pixels
// beyond the boundary.
template <class Holds>
int count_lines(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines, const Holds& holds) {
  constexpr double reach = 0.9;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  int count = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, reach, i, lines);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const double along_m = boundaries_m(scene.marker, tau_rad)[boundary];
    const double scale_px_per_m = along_px_per_m(scene, pose, azimuth_rad, along_m);
    count += holds([&](double beyond_px) {
      const Eigen::Vector3d on_shaft =
          surface_point(scene.marker.radius_m(), azimuth_rad, along_m + beyond_px / scale_px_per_m);
      return scene.class_on_shaft(pose.camera_from_unrolled * on_shaft);
    });
  }
  return count;
}

}  // namespace

int lines_with_both_colours(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr std::array<double, 2> beside_px{2.5, 4};  // beyond what a lens blurs
  return count_lines(scene, pose, boundary, lines, [&](const auto& colour_at) {
    return std::all_of(beside_px.begin(), beside_px.end(), [&](double px) {
      return colour_at(-px) == scene.bands[boundary - 1] && colour_at(px) == scene.bands[boundary];
    });
  });
}

int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines) {
  constexpr double beside_px = 4;
  return count_lines(scene, pose, boundary, lines, [&](const auto& colour_at) {
    return (boundary == 0 || scene.is_ours(colour_at(-beside_px))) &&
           (boundary == 3 || scene.is_ours(colour_at(beside_px)));
  });
}

double spilled_in_patches(const Scene& scene, const ShaftPose& pose) {
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return 0;
  return std::max(spilled_beyond(scene, pose, *view, false), spilled_beyond(scene, pose, *view, true));
}

}  // namespace lapservo::internal
