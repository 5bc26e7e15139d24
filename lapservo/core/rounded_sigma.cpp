#include "lapservo/core/rounded_sigma.h"

#include <array>
#include <charconv>

namespace lapservo::internal {

double rounded_sigma(double sigma) {
  const std::string text = sigma_text(sigma);
  double rounded = sigma;
  std::from_chars(text.data(), text.data() + text.size(), rounded);
  return rounded;
}

std::string sigma_text(double sigma) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), sigma, std::chars_format::general, 3);
  return {text.data(), end.ptr};
}

}  // namespace lapservo::internal
