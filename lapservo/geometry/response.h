#pragma once

#include <array>
#include <optional>
#include <vector>

namespace lapservo {

/// The light of each 8-bit value.
using LightTable = std::array<float, 256>;

/// How pixel values encode light. Values and light are in [0, 1].
struct Response {
  enum class Kind { srgb, rec709, power, table };
  Kind kind = Kind::srgb;
  double gamma = 1;  ///< for Kind::power: light = value^gamma; 1 is linear
  /// For Kind::table: light at value, straight lines between; both rise strictly from 0 to 1 and are equally long.
  std::vector<double> table_light{}, table_value{};
  /// One standard deviation of values by it, and of each number of the tables; none where it was not measured.
  std::optional<double> sigma{};
  std::vector<double> sigma_light{}, sigma_value{};

  bool operator==(const Response&) const = default;
  double light_from_value(double value) const;
  double value_from_light(double light) const;
  /// Light for each 8-bit value.
  LightTable table() const;
};

}  // namespace lapservo
