#include "lapservo/vision/search/explained_colours.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_evidence.h"

namespace lapservo::internal {
namespace {

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

// By colour class, what bands it may be; 0 for what is none of them.
using BandsOfClass = std::array<std::uint8_t, 256>;

BandsOfClass bands_of_class(const Scene& scene) {
  BandsOfClass bands{};
  for (std::size_t band = 3; band-- > 0;) bands[scene.bands[band]] = bit_of(band);
  return bands;
}

// Places along a line of the shaft in the image, `Before` of them before the marker and as many behind it. All are
// projected at once, in vectors: half of what a search for hidden markers costs is this.
template <std::size_t Before>
class LineInImage {
 public:
  static constexpr std::size_t count = places_along + 2 * Before;
  using Places = std::array<double, count>;

  static Places along_m(const Marker& marker) {
    Places places;
    for (std::size_t k = 0; k < count; ++k)
      places[k] = place_along_m(marker, static_cast<int>(k) - static_cast<int>(Before));
    return places;
  }

  LineInImage(const Scene& scene, const Eigen::Vector3d& base, const Eigen::Vector3d& axis, const Places& along_m)
      : scene_(scene) {
    const Camera& camera = scene.camera;
    for (std::size_t k = 0; k < count; ++k) {
      const double inverse_z = 1 / (depth_m_[k] = base.z() + along_m[k] * axis.z());
      u_px_[k] = camera.cx_px + camera.fx_px * (base.x() + along_m[k] * axis.x()) * inverse_z;
      v_px_[k] = camera.cy_px + camera.fy_px * (base.y() + along_m[k] * axis.y()) * inverse_z;
    }
    if (!camera.distorted()) return;
    for (std::size_t k = 0; k < count; ++k) {
      if (!scene.field.contains(base + along_m[k] * axis)) depth_m_[k] = 0;
      const Eigen::Vector2d raw_px = camera.raw_from_ideal({u_px_[k], v_px_[k]});
      u_px_[k] = raw_px.x(), v_px_[k] = raw_px.y();
    }
  }

  // Nullptr where the image says nothing of it: as Scene::class_on_shaft has it, or, beside it, class_at_point.
  const std::uint8_t* pixel(std::size_t k, bool on_shaft) const {
    const double u = u_px_[k] + 0.5, v = v_px_[k] + 0.5;
    if (!(depth_m_[k] > 1e-3 && u >= 0 && v >= 0 && u < scene_.image.width_px && v < scene_.image.height_px))
      return nullptr;
    if (!scene_.others.empty()) {
      const Eigen::Vector2d raw_px(u_px_[k], v_px_[k]);
      if (scene_.hidden(raw_px, depth_m_[k]) || (!on_shaft && scene_.class_beside(raw_px) == Scene::outside))
        return nullptr;
    }
    return scene_.image.pixel(static_cast<int>(u), static_cast<int>(v));
  }

 private:
  const Scene& scene_;
  Places u_px_, v_px_, depth_m_;
};

// `here`: the bands that may show there; none beyond the marker's ends.
double gain(const std::uint8_t* bgr, std::uint8_t seen, std::uint8_t here) {
  const Shows shows = !seen ? grey_or_other(bgr) : seen & here ? Shows::its_band : Shows::another_band;
  return colour_evidence.of(here ? Place::band : Place::shaft, shows);
}

double gain_beside(const std::uint8_t* bgr, std::uint8_t seen) {
  return colour_evidence.of(Place::beside, seen ? Shows::another_band : grey_or_other(bgr));
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

double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned, double above_px2) {
  constexpr std::size_t beyond = 6;
  constexpr int lines = 9;
  constexpr double line_reach = 0.85, rounding = 1e-6;
  constexpr std::array beside_radii{1.08, 1.2};
  const double most_of_line = places_along + 2 * beyond * colour_evidence.of(Place::shaft, Shows::grey);
  const double most_beside = 2 * beside_radii.size() * places_along * colour_evidence.of(Place::beside, Shows::other);
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return no_area_px2;
  const double radius_m = scene.marker.radius_m(), whole_px2 = area_px2(scene, pose);
  const double least_gain = above_px2 * (lines * places_along) / whole_px2 - rounding;
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  const BandsOfClass band_of = bands_of_class(scene);
  const auto along_m = LineInImage<beyond>::along_m(scene.marker);
  BandsAlong bands{};
  if (!turned) bands = bands_of_whole_turn(scene.marker);
  double gained = 0;
  for (int i = 0; i < lines; ++i) {
    if (gained + (lines - i) * most_of_line + most_beside < least_gain) return no_area_px2;
    const double azimuth_rad = visible_azimuth_rad(*view, line_reach, i, lines);
    if (turned) bands = bands_at(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(radius_m, azimuth_rad, 0);
    const LineInImage<beyond> line(scene, base, axis, along_m);
    for (std::size_t k = 0; k < line.count; ++k) {
      const std::uint8_t here = k >= beyond && k < beyond + places_along ? bands[k - beyond] : 0;
      if (const std::uint8_t* bgr = line.pixel(k, here != 0)) gained += gain(bgr, band_of[scene.classes(bgr)], here);
    }
  }
  if (gained + most_beside < least_gain) return no_area_px2;
  for (const double side : {-1.0, 1.0})
    for (const double radii : beside_radii) {
      const Eigen::Vector3d base =
          pose.camera_from_unrolled * surface_point(radii * radius_m, view->facing_azimuth_rad + side * pi / 2, 0);
      const LineInImage<0> line(scene, base, axis, LineInImage<0>::along_m(scene.marker));
      for (std::size_t k = 0; k < line.count; ++k)
        if (const std::uint8_t* bgr = line.pixel(k, false)) gained += gain_beside(bgr, band_of[scene.classes(bgr)]);
    }
  return gained / (lines * places_along) * whole_px2;
}

}  // namespace lapservo::internal
