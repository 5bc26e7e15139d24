#include "lapservo/sim/shaft_lighting.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

Light printed_colour(double hue_deg) {
  constexpr double saturation = 0.91, value = 0.84;
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60, 6.0);
    return value - value * saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0);
  };
  const Response srgb;
  return {static_cast<float>(srgb.light_from_value(channel(1))), static_cast<float>(srgb.light_from_value(channel(3))),
          static_cast<float>(srgb.light_from_value(channel(5)))};
}

Lighting at_power(Lighting lighting, float power) {
  lighting.diffuse *= power;
  lighting.specular *= power;
  return lighting;
}

std::array<Light, 8> reflectances(const ShaftModel& shaft) {
  std::array<Light, 8> of_part;
  const auto set = [&](Part part, const Light& light) { of_part.at(static_cast<std::size_t>(part)) = light; };
  set(Part::nothing, Light::Zero());
  set(Part::band_0, printed_colour(shaft.marker.hues_deg[0]));
  set(Part::band_1, printed_colour(shaft.marker.hues_deg[1]));
  set(Part::band_2, printed_colour(shaft.marker.hues_deg[2]));
  set(Part::shaft, Light::Constant(shaft.shaft_reflectance));
  set(Part::film_edge, Light::Zero());  // that of the band there
  set(Part::tip, Light::Constant(0.2F));
  set(Part::blood, Light(0.012F, 0.008F, 0.11F));
  return of_part;
}

ShaftLighting::ShaftLighting(const Lighting& lighting, const ShaftTracer& tracer)
    : lighting_(lighting),
      camera_(tracer.camera_in_facing_frame()),
      radius_m_(tracer.radius_m()),
      first_row_m_(tracer.shaft_start_m()),
      filled_(static_cast<std::size_t>((tracer.shaft_end_m() - tracer.shaft_start_m()) / row_m) + 3),
      grid_(columns * filled_.size()) {
  for (std::size_t i = 0; i < lamps_.size(); ++i) lamps_[i] = tracer.in_facing_frame(lighting.lamps_in_camera_m[i]);
}

Lit light_at(const Lighting& lighting, const std::array<Eigen::Vector3f, 2>& lamps, const Eigen::Vector3f& camera,
             const Eigen::Vector3f& point, const Eigen::Vector3f& normal) {
  const auto reference_m = static_cast<float>(lighting.reference_m);
  const Eigen::Vector3f to_camera = (camera - point).normalized();
  Lit lit{lighting.ambient, 0};
  for (const Eigen::Vector3f& lamp : lamps) {
    const Eigen::Vector3f to_lamp = lamp - point;
    const float distance_m = to_lamp.norm(), facing = normal.dot(to_lamp) / distance_m;
    if (!(facing > 0)) continue;
    const float ratio = distance_m / reference_m, falloff = 1 / (1 + ratio * ratio);
    lit.matt += lighting.diffuse * falloff * facing;
    const float half = normal.dot((to_lamp / distance_m + to_camera).normalized());
    if (half > 0) lit.gloss += lighting.specular * falloff * std::pow(half, lighting.specular_exponent);
  }
  return lit;
}

const Lit* ShaftLighting::row(std::size_t index) {
  Lit* const out = grid_.data() + index * columns;
  if (filled_[index]) return out;
  filled_[index] = 1;
  const float along_m = first_row_m_ + row_m * static_cast<float>(index);
  for (std::size_t column = 0; column < columns; ++column) {
    const float azimuth_rad = column_rad * (static_cast<float>(column) - 0.5F * (columns - 1));
    const Eigen::Vector3f normal(std::cos(azimuth_rad), std::sin(azimuth_rad), 0);
    out[column] = at(radius_m_ * normal + Eigen::Vector3f(0, 0, along_m), normal);
  }
  return out;
}

Lit ShaftLighting::on_side(float azimuth_rad, float along_m) {
  const float x = std::clamp(azimuth_rad / column_rad + 0.5F * (columns - 1), 0.0F, columns - 1.001F);
  const float y = std::clamp((along_m - first_row_m_) / row_m, 0.0F, static_cast<float>(filled_.size()) - 1.001F);
  const auto column = static_cast<std::size_t>(x), line = static_cast<std::size_t>(y);
  const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(line);
  const Lit* above = row(line) + column;
  const Lit* below = row(line + 1) + column;
  const auto mix = [&](float Lit::*term) {
    const float top = above[0].*term + fx * (above[1].*term - above[0].*term);
    const float bottom = below[0].*term + fx * (below[1].*term - below[0].*term);
    return top + fy * (bottom - top);
  };
  return {mix(&Lit::matt), mix(&Lit::gloss)};
}

}  // namespace lapservo::internal
