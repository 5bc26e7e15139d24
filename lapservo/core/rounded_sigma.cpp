#include "lapservo/core/rounded_sigma.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace lapservo::internal {

double rounded_sigma(double sigma) {
  const std::string text = sigma_text(sigma);
  double rounded = sigma;
  std::from_chars(text.data(), text.data() + text.size(), rounded);
  return rounded;
}

double rounded_by_sigma(double value, double sigma) {
  if (!(sigma > 0) || !std::isfinite(sigma) || !std::isfinite(value)) return value;
  constexpr int digits_below_sigma = 4;
  const int decimals = std::max(0, digits_below_sigma - static_cast<int>(std::floor(std::log10(sigma))));
  std::array<char, 1024> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, decimals);
  double rounded = value;
  std::from_chars(text.data(), end.ptr, rounded);
  return rounded;
}

std::string sigma_text(double sigma) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), sigma, std::chars_format::general, 3);
  return {text.data(), end.ptr};
}

}  // namespace lapservo::internal
