#include "lapservo/geometry/response.h"

#include <cmath>
#include <cstddef>

namespace lapservo {

// sRGB: IEC 61966-2-1.
double Response::light_from_value(double value) const {
  if (kind == Kind::power) return std::pow(value, gamma);
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double Response::value_from_light(double light) const {
  if (kind == Kind::power) return std::pow(light, 1 / gamma);
  return light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

std::array<float, 256> Response::table() const {
  std::array<float, 256> light{};
  for (std::size_t value = 0; value < light.size(); ++value)
    light[value] = static_cast<float>(light_from_value(static_cast<double>(value) / 255));
  return light;
}

}  // namespace lapservo
