#include "lapservo/vision/search/explained_colours.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_evidence.h"
#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {
namespace {

// Bits of the bands that may show at each place along a line of the marker.
constexpr int places_along = 36;
using BandsAlong = std::array<std::uint8_t, places_along>;

BandsAlong bands_at(const Marker& marker, double tau_rad) {
  BandsAlong bands{};
  if (!is_printed(marker, tau_rad)) return bands;
  const auto ends_m = boundaries_m(marker, tau_rad);
  for (int k = 0; k < places_along; ++k) {
    const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), marker.length_m() * (k + 0.5) / places_along) -
                      ends_m.begin() - 1;
    if (band >= 0 && band < 3) bands[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(1 << band);
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

// By colour class, what bands it may be; 0 for what is none of them.
auto bands_of_class(const Scene& scene) {
  std::array<std::uint8_t, Scene::outside + 1> bands{};
  for (std::size_t band = 3; band-- > 0;) bands[scene.bands[band]] = static_cast<std::uint8_t>(1 << band);
  return bands;
}

// `here`: the bands that may show there; none beyond the marker's ends.
double gain(const std::uint8_t* bgr, std::uint8_t seen, std::uint8_t here) {
  const Shows shows = !seen ? grey_or_other(bgr) : seen & here ? Shows::its_band : Shows::another_band;
  return colour_evidence.of(here ? Place::band : Place::shaft, shows);
}

double area_px2(const Scene& scene, const ShaftPose& pose) {
  const double length_m = scene.marker.length_m();
  const Eigen::Vector3d first = point_on_axis(pose, 0), last = point_on_axis(pose, length_m);
  if (!(first.z() > LensField::nearest_m) || !(last.z() > LensField::nearest_m)) return 0;
  const double width_px = scene.marker.diameter_m * scene.camera.fx_px / point_on_axis(pose, length_m / 2).norm();
  return width_px * (scene.camera.ideal_from_point(last) - scene.camera.ideal_from_point(first)).norm();
}

}  // namespace

double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned, double above_px2) {
  constexpr std::size_t beyond = 6;
  constexpr int lines = 9;
  constexpr double line_reach = 0.85, rounding = 1e-6;
  constexpr std::array beside_radii{1.08, 1.2};
  const double most_of_line = places_along + 2 * beyond * colour_evidence.of(Place::shaft, Shows::grey);
  const double most_beside = 2 * beside_radii.size() * places_along * colour_evidence.of(Place::beside, Shows::other);
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return no_area_px2;
  const double whole_px2 = area_px2(scene, pose);
  const double least_gain = above_px2 * (lines * places_along) / whole_px2 - rounding;
  const Eigen::Vector3d step =
      pose.camera_from_unrolled.rotation * Eigen::Vector3d(0, 0, scene.marker.length_m() / places_along);
  const auto band_of = bands_of_class(scene);
  BandsAlong bands{};
  if (!turned) bands = bands_of_whole_turn(scene.marker);
  double gained = 0;
  for (int i = 0; i < lines; ++i) {
    if (gained + (lines - i) * most_of_line + most_beside < least_gain) return no_area_px2;
    const double azimuth_rad = visible_azimuth_rad(*view, line_reach, i, lines);
    if (turned) bands = bands_at(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    const Eigen::Vector3d base = point_on(pose, scene.marker, azimuth_rad, 0);
    const LineInImage<places_along + 2 * beyond> line(scene, base - beyond * step, step);
    for (std::size_t k = 0; k < places_along + 2 * beyond; ++k) {
      const std::uint8_t here = k >= beyond && k < beyond + places_along ? bands[k - beyond] : 0;
      if (const std::uint8_t* bgr = line.pixel(k, here != 0)) gained += gain(bgr, band_of[scene.classes(bgr)], here);
    }
  }
  if (gained + most_beside < least_gain) return no_area_px2;
  for (const double side : {-1.0, 1.0})
    for (const double radii : beside_radii) {
      const Eigen::Vector3d base =
          pose.camera_from_unrolled *
          surface_point(radii * scene.marker.radius_m(), view->facing_azimuth_rad + side * pi / 2, 0);
      const LineInImage<places_along> line(scene, base, step);
      for (std::size_t k = 0; k < places_along; ++k)
        if (const std::uint8_t* bgr = line.pixel(k, false))
          gained +=
              colour_evidence.of(Place::beside, band_of[scene.classes(bgr)] ? Shows::another_band : grey_or_other(bgr));
    }
  return gained / (lines * places_along) * whole_px2;
}

}  // namespace lapservo::internal
