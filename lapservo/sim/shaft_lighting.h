#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "lapservo/sim/scene.h"
#include "lapservo/sim/shaft_tracer.h"

namespace lapservo::internal {

/// Light that leaves a point towards the camera: reflectance * diffuse + specular.
struct Lit {
  float matt = 0, gloss = 0;
};

/// At a point, seen from `camera`, all in one frame; exact.
Lit light_at(const Lighting& lighting, const std::array<Eigen::Vector3f, 2>& lamps, const Eigen::Vector3f& camera,
             const Eigen::Vector3f& point, const Eigen::Vector3f& normal);

/// Light on one shaft in one pose. Over a cylinder it changes slowly, so it is computed on a grid of azimuth and
/// length, row by row on first use, and interpolated (to 0.2 % of white).
class ShaftLighting {
 public:
  ShaftLighting(const Lighting& lighting, const ShaftTracer& tracer);

  /// On the film or the shaft; azimuth from the facing generatrix.
  Lit on_side(float azimuth_rad, float along_m);
  /// At any point (facing frame); exact.
  Lit at(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) const {
    return light_at(lighting_, lamps_, camera_, point, normal);
  }

 private:
  static constexpr std::size_t columns = 96;
  static constexpr float column_rad = 3.14159265F / (columns - 1), row_m = 0.0025F;

  const Lit* row(std::size_t index);

  Lighting lighting_;
  Eigen::Vector3f camera_;
  std::array<Eigen::Vector3f, 2> lamps_;
  float radius_m_, first_row_m_;
  std::vector<char> filled_;  // per row
  std::vector<Lit> grid_;
};

/// The lamps dimmed to `power`, 1 being full: their diffuse and specular light scales, the ambient part stays.
Lighting at_power(Lighting lighting, float power);

/// Reflectance in linear light of each Part of a shaft.
std::array<Light, 8> reflectances(const ShaftModel& shaft);

/// Reflectance in linear light of a printed hue: HSV(hue, 0.91, 0.84) in sRGB values, b g r.
Light printed_colour(double hue_deg);

}  // namespace lapservo::internal
