#include "lapservo/geometry/response.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace lapservo {

namespace {

// Rec. ITU-R BT.709's curve with BT.2020's digits, with which its two parts meet.
constexpr double rec709_alpha = 1.099296826809442, rec709_beta = 0.018053968510807;

// y at x on the straight lines through points whose x rise from 0 to 1.
double interpolated(const std::vector<double>& xs, const std::vector<double>& ys, double x) {
  const auto above = std::upper_bound(xs.begin() + 1, xs.end() - 1, x);
  const auto i = static_cast<std::size_t>(above - xs.begin());
  return ys[i - 1] + (ys[i] - ys[i - 1]) * (x - xs[i - 1]) / (xs[i] - xs[i - 1]);
}

}  // namespace

// sRGB: IEC 61966-2-1.
double Response::light_from_value(double value) const {
  switch (kind) {
    case Kind::power:
      return std::pow(value, gamma);
    case Kind::rec709:
      return value < 4.5 * rec709_beta ? value / 4.5 : std::pow((value + rec709_alpha - 1) / rec709_alpha, 1 / 0.45);
    case Kind::table:
      return interpolated(table_value, table_light, value);
    case Kind::srgb:
      break;
  }
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double Response::value_from_light(double light) const {
  switch (kind) {
    case Kind::power:
      return std::pow(light, 1 / gamma);
    case Kind::rec709:
      return light < rec709_beta ? 4.5 * light : rec709_alpha * std::pow(light, 0.45) - (rec709_alpha - 1);
    case Kind::table:
      return interpolated(table_light, table_value, light);
    case Kind::srgb:
      break;
  }
  return light <= 0.0031308 ? light * 12.92 : 1.055 * std::pow(light, 1 / 2.4) - 0.055;
}

LightTable Response::table() const {
  LightTable light{};
  for (std::size_t value = 0; value < light.size(); ++value)
    light[value] = static_cast<float>(light_from_value(static_cast<double>(value) / 255));
  return light;
}

}  // namespace lapservo
