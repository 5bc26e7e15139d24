#include "lapservo/sim/shaft_caster.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/response.h"

namespace lapservo {
namespace {

enum Part : std::uint8_t { nothing, band_0, band_1, band_2, shaft, tip, blood = 16, seam_side = 32 };

}  // namespace

Light printed_color(double hue_deg) {
  constexpr double saturation = 0.97, value = 0.83;
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60, 6.0);
    return value - value * saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  const Response srgb;
  return {static_cast<float>(srgb.light_from_value(channel(1))), static_cast<float>(srgb.light_from_value(channel(3))),
          static_cast<float>(srgb.light_from_value(channel(5)))};
}

ShaftCaster::ShaftCaster(const ShaftModel& model, const ShaftPlacement& placement, const Lighting& lighting)
    : model_(model), placement_(placement), lighting_(lighting) {
  const Rigid3 cylinder_from_camera = placement.camera_from_unrolled.inverse();
  cylinder_from_camera_ = cylinder_from_camera.rotation.toRotationMatrix();
  camera_ = cylinder_from_camera.translation;
  for (std::size_t i = 0; i < lamps_.size(); ++i) lamps_[i] = cylinder_from_camera * lighting.lamps_in_camera_m[i];
  albedo_[nothing] = Light::Zero();
  for (std::size_t band = 0; band < 3; ++band) albedo_[band_0 + band] = printed_color(model.marker.hues_deg[band]);
  albedo_[shaft] = Light::Constant(0.03F);
  albedo_[tip] = Light::Constant(0.2F);
}

bool ShaftCaster::hit_side(const Eigen::Vector3d& ray, double radius_m, double from_m, double to_m, Hit& hit) const {
  const double a = ray.head<2>().squaredNorm(), b = camera_.head<2>().dot(ray.head<2>());
  const double c = camera_.head<2>().squaredNorm() - radius_m * radius_m;
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0) || !(a > 0)) return false;
  const double depth_m = (-b - std::sqrt(discriminant)) / a;
  if (!(depth_m > 1e-3) || depth_m >= hit.depth_m) return false;
  const Eigen::Vector3d point = camera_ + depth_m * ray;
  if (point.z() < from_m || point.z() > to_m) return false;
  hit.depth_m = depth_m;
  hit.point = point;
  hit.normal = Eigen::Vector3d(point.x() / radius_m, point.y() / radius_m, 0);
  return true;
}

bool ShaftCaster::hit_disc(const Eigen::Vector3d& ray, double along_m, double inner_m, double outer_m, double facing,
                           Hit& hit) const {
  if (ray.z() * facing >= 0) return false;
  const double depth_m = (along_m - camera_.z()) / ray.z();
  if (!(depth_m > 1e-3) || depth_m >= hit.depth_m) return false;
  const Eigen::Vector3d point = camera_ + depth_m * ray;
  const double radius_m = point.head<2>().norm();
  if (radius_m < inner_m || radius_m > outer_m) return false;
  hit.depth_m = depth_m;
  hit.point = point;
  hit.normal = Eigen::Vector3d(0, 0, facing);
  return true;
}

bool ShaftCaster::hit_tip(const Eigen::Vector3d& ray, Hit& hit) const {
  const double radius_m = 1.05 * model_.marker.radius_m();
  const Eigen::Vector3d centre(0, 0, model_.marker.length_m() + model_.shaft_beyond_m);
  const Eigen::Vector3d from = camera_ - centre;
  const double a = ray.squaredNorm(), b = from.dot(ray), c = from.squaredNorm() - radius_m * radius_m;
  const double discriminant = b * b - a * c;
  if (!(discriminant > 0)) return false;
  const double depth_m = (-b - std::sqrt(discriminant)) / a;
  if (!(depth_m > 1e-3) || depth_m >= hit.depth_m) return false;
  hit.depth_m = depth_m;
  hit.point = camera_ + depth_m * ray;
  hit.normal = (hit.point - centre) / radius_m;
  return true;
}

std::uint8_t ShaftCaster::marker_part(Hit& hit) const {
  hit.tau_rad = wrap_two_pi(std::atan2(hit.point.y(), hit.point.x()) - placement_.psi_rad - model_.marker.seam_rad);
  const double along_m = std::clamp(hit.point.z(), 0.0, model_.marker.length_m());
  for (const Blotch& blotch : model_.blotches) {
    const double around_m = wrap_pi(hit.tau_rad - blotch.azimuth_rad) * model_.marker.radius_m();
    const double beside_m = along_m - blotch.along_m;
    if (around_m * around_m + beside_m * beside_m < blotch.radius_m * blotch.radius_m) return blood;
  }
  const auto e = boundaries_m(model_.marker, hit.tau_rad);
  const std::uint8_t band = along_m < e[1] ? band_0 : (along_m < e[2] ? band_1 : band_2);
  // Both sides of the seam are parts of their own, so that edges of colour along it are not missed.
  return hit.tau_rad < pi ? band : static_cast<std::uint8_t>(band | seam_side);
}

ShaftCaster::Hit ShaftCaster::cast(const Eigen::Vector3d& ray_in_camera) const {
  const Eigen::Vector3d ray = cylinder_from_camera_ * ray_in_camera;
  const double radius_m = model_.marker.radius_m(), inner_m = radius_m - model_.film_m;
  const double length_m = model_.marker.length_m();
  Hit hit;
  // Each takes over from what lies behind it.
  if (hit_side(ray, radius_m, 0, length_m, hit)) hit.part = band_0;
  if (model_.film_m > 0) {
    if (hit_disc(ray, 0, inner_m, radius_m, -1, hit)) hit.part = band_0;
    if (hit_disc(ray, length_m, inner_m, radius_m, 1, hit)) hit.part = band_0;
  }
  if (hit_side(ray, inner_m, -model_.shaft_before_m, length_m + model_.shaft_beyond_m, hit)) hit.part = shaft;
  if (hit_tip(ray, hit)) hit.part = tip;
  if (hit.part == band_0) hit.part = marker_part(hit);
  return hit;
}

Light ShaftCaster::shade(const Hit& hit) const {
  static const Light blood_albedo(0.012F, 0.008F, 0.11F);
  const std::uint8_t kind = hit.part & ~seam_side;
  const Light& albedo = kind == blood ? blood_albedo : albedo_[kind];
  const Eigen::Vector3d to_camera = (camera_ - hit.point).normalized();
  float diffuse = 0, specular = 0;
  for (const Eigen::Vector3d& lamp : lamps_) {
    const Eigen::Vector3d to_lamp = lamp - hit.point;
    const double distance_m = to_lamp.norm();
    const double facing = hit.normal.dot(to_lamp) / distance_m;
    if (facing <= 0) continue;
    const double ratio = lighting_.reference_m / std::max(distance_m, 0.5 * lighting_.reference_m);
    const auto falloff = static_cast<float>(0.5 * ratio * ratio);
    diffuse += falloff * static_cast<float>(facing);
    const double half = hit.normal.dot((to_lamp / distance_m + to_camera).normalized());
    if (half > 0.8) specular += falloff * std::pow(static_cast<float>(half), lighting_.specular_exponent);
  }
  return albedo * (lighting_.ambient + lighting_.diffuse * diffuse) + Light::Constant(lighting_.specular * specular);
}

}  // namespace lapservo
