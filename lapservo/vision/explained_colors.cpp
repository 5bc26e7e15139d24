#include "lapservo/vision/explained_colors.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

// What a sample gains; one that has the colour that belongs there 1.
struct SampleGains {
  double another_band = -1, blood = -0.15, bare = -0.6;                   // on the marker
  double marker_beyond = -0.5, bare_beyond = 0.15, blood_beyond = -0.15;  // beyond its ends, on the shaft
  double marker_beside = -0.5;                                            // beside the shaft
};
constexpr SampleGains sample_gains;

// Bits of the bands that may show at each place along a line of the marker.
constexpr int places_along = 36;
using BandsAlong = std::array<std::uint8_t, places_along>;

std::uint8_t bit_of(std::size_t band) {
  return static_cast<std::uint8_t>(1U << band);
}

double place_along_m(const Marker& marker, int k) {
  return marker.length_m() * (k + 0.5) / places_along;
}

BandsAlong bands_at(const Marker& marker, double tau_rad) {
  BandsAlong bands{};
  if (!is_printed(marker, tau_rad)) return bands;
  const auto ends_m = boundaries_m(marker, tau_rad);
  for (int k = 0; k < places_along; ++k) {
    const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), place_along_m(marker, k)) - ends_m.begin() - 1;
    if (band >= 0 && band < 3) bands[static_cast<std::size_t>(k)] = bit_of(static_cast<std::size_t>(band));
  }
  return bands;
}

BandsAlong bands_of_whole_turn(const Marker& marker) {
  constexpr int parts = 4;
  constexpr double inside = 0.999;  // at its lower edge the print ends
  BandsAlong all{};
  for (int i = 0; i <= parts; ++i) {
    const BandsAlong bands = bands_at(marker, inside * marker.covered_rad() * i / parts);
    for (std::size_t k = 0; k < all.size(); ++k) all[k] |= bands[k];
  }
  return all;
}

std::uint8_t bit_of_color(const Scene& scene, std::uint8_t color) {
  for (std::size_t band = 0; band < 3; ++band)
    if (color == scene.bands[band]) return bit_of(band);
  return 0;
}

// Of a place inside the image without the marker's colour: whether it is as grey as bare shaft, or as red as blood.
bool is_grey(const Scene& scene, const Eigen::Vector3d& point) {
  constexpr int dark = 20;  // there noise makes any colour
  constexpr double least_saturation = 0.35;
  const Eigen::Vector2d raw_px = scene.camera.raw_from_point(point);
  const std::uint8_t* bgr = scene.image.pixel(static_cast<int>(raw_px.x() + 0.5), static_cast<int>(raw_px.y() + 0.5));
  const auto [least, most] = std::minmax({bgr[0], bgr[1], bgr[2]});
  return most < dark || most - least < least_saturation * most;
}

double gain_on_marker(const Scene& scene, const Eigen::Vector3d& point, std::uint8_t bands) {
  const std::uint8_t color = scene.class_on_shaft(point);
  if (color == Scene::outside) return 0;
  const std::uint8_t seen = bit_of_color(scene, color);
  if (seen) return seen & bands ? 1 : sample_gains.another_band;
  return is_grey(scene, point) ? sample_gains.bare : sample_gains.blood;
}

double gain_beyond(const Scene& scene, const Eigen::Vector3d& point) {
  const std::uint8_t color = scene.class_at_point(point);
  if (color == Scene::outside) return 0;
  if (scene.is_ours(color)) return sample_gains.marker_beyond;
  return is_grey(scene, point) ? sample_gains.bare_beyond : sample_gains.blood_beyond;
}

double area_px2(const Scene& scene, const ShaftPose& pose) {
  const auto on_axis = [&](double along_m) -> Eigen::Vector3d {
    return pose.camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
  };
  const double length_m = scene.marker.length_m();
  const Eigen::Vector3d first = on_axis(0), last = on_axis(length_m);
  if (!(first.z() > 1e-3) || !(last.z() > 1e-3)) return 0;
  const double width_px = scene.marker.diameter_m * scene.camera.fx_px / on_axis(length_m / 2).norm();
  return width_px * (scene.camera.ideal_from_point(last) - scene.camera.ideal_from_point(first)).norm();
}

}  // namespace

double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned) {
  constexpr int lines = 9, beyond = 6;
  constexpr double line_reach = 0.85;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return -1e9;
  const double radius_m = scene.marker.radius_m();
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  BandsAlong bands{};
  if (!turned) bands = bands_of_whole_turn(scene.marker);
  double gained = 0;
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = visible_azimuth_rad(*view, line_reach, i, lines);
    if (turned) bands = bands_at(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(radius_m, azimuth_rad, 0);
    for (int k = -beyond; k < places_along + beyond; ++k) {
      const Eigen::Vector3d point = base + place_along_m(scene.marker, k) * axis;
      const bool on_marker = k >= 0 && k < places_along && bands[static_cast<std::size_t>(k)];
      gained +=
          on_marker ? gain_on_marker(scene, point, bands[static_cast<std::size_t>(k)]) : gain_beyond(scene, point);
    }
  }
  for (const double side : {-1.0, 1.0})
    for (const double radii : {1.08, 1.2}) {
      const Eigen::Vector3d base =
          pose.camera_from_unrolled * surface_point(radii * radius_m, view->facing_azimuth_rad + side * pi / 2, 0);
      for (int k = 0; k < places_along; ++k)
        if (scene.is_ours(scene.class_at_point(base + place_along_m(scene.marker, k) * axis)))
          gained += sample_gains.marker_beside;
    }
  return gained / (lines * places_along) * area_px2(scene, pose);
}

}  // namespace lapservo::internal
