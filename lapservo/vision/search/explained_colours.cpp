#include "lapservo/vision/search/explained_colours.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

// The gain of a sample; one that has the colour that belongs there 1.
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

// By colour class, what bands it may be; 0 for what is none of them.
using BandsOfClass = std::array<std::uint8_t, 256>;

BandsOfClass bands_of_class(const Scene& scene) {
  BandsOfClass bands{};
  for (std::size_t band = 3; band-- > 0;) bands[scene.bands[band]] = bit_of(band);
  return bands;
}

// For a pixel without the marker's colour: whether it is as grey as bare shaft, or as red as blood.
bool is_grey(const std::uint8_t* bgr) {
  constexpr int dark = 20;  // there noise makes any colour
  constexpr double least_saturation = 0.35;
  const int b = bgr[0], g = bgr[1], r = bgr[2];
  const int most = std::max(std::max(b, g), r), least = std::min(std::min(b, g), r);
  return static_cast<int>(most < dark) | static_cast<int>(most - least < least_saturation * most);
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

// The gain of a sample by what it shows: blood, none, another band, the right one.
using Gains = std::array<double, 4>;
constexpr Gains gains_on_marker{sample_gains.blood, sample_gains.bare, sample_gains.another_band, 1};
constexpr Gains gains_beyond{sample_gains.blood_beyond, sample_gains.bare_beyond, sample_gains.marker_beyond,
                             sample_gains.marker_beyond};

// `here`: the bands that may show there; none beyond the marker's ends.
double gain(const std::uint8_t* bgr, std::uint8_t seen, std::uint8_t here) {
  const std::size_t of_colour = 2 + static_cast<std::size_t>((seen & here) != 0);
  const std::size_t shows = seen ? of_colour : static_cast<std::size_t>(is_grey(bgr));
  return here ? gains_on_marker[shows] : gains_beyond[shows];
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
  constexpr double line_reach = 0.85, most_of_line = places_along + 2 * beyond * sample_gains.bare_beyond;
  constexpr double rounding = 1e-6;
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
    if (gained + (lines - i) * most_of_line < least_gain) return no_area_px2;
    const double azimuth_rad = visible_azimuth_rad(*view, line_reach, i, lines);
    if (turned) bands = bands_at(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    const Eigen::Vector3d base = pose.camera_from_unrolled * surface_point(radius_m, azimuth_rad, 0);
    const LineInImage<beyond> line(scene, base, axis, along_m);
    for (std::size_t k = 0; k < line.count; ++k) {
      const std::uint8_t here = k >= beyond && k < beyond + places_along ? bands[k - beyond] : 0;
      if (const std::uint8_t* bgr = line.pixel(k, here != 0)) gained += gain(bgr, band_of[scene.classes(bgr)], here);
    }
  }
  if (gained < least_gain) return no_area_px2;
  for (const double side : {-1.0, 1.0})
    for (const double radii : {1.08, 1.2}) {
      const Eigen::Vector3d base =
          pose.camera_from_unrolled * surface_point(radii * radius_m, view->facing_azimuth_rad + side * pi / 2, 0);
      const LineInImage<0> line(scene, base, axis, LineInImage<0>::along_m(scene.marker));
      for (std::size_t k = 0; k < line.count; ++k)
        if (const std::uint8_t* bgr = line.pixel(k, false); bgr && band_of[scene.classes(bgr)])
          gained += sample_gains.marker_beside;
    }
  return gained / (lines * places_along) * whole_px2;
}

}  // namespace lapservo::internal
