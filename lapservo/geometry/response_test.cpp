#include "lapservo/geometry/response.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::response_test {

std::vector<Response> responses() {
  return {{},
          {Response::Kind::rec709},
          {Response::Kind::power, 1},
          {Response::Kind::power, 2.2},
          {Response::Kind::power, 0.45},
          {Response::Kind::table, 1, {0, 1}, {0, 1}},
          {Response::Kind::table, 1, {0, 0.1, 0.4, 1}, {0, 0.3, 0.7, 1}}};
}

TEST(Response, ValueAndLightRoundTripFromZeroToOneAndTheTableHoldsThem) {
  for (const Response& response : responses()) {
    EXPECT_EQ(response.light_from_value(0), 0);
    EXPECT_NEAR(response.light_from_value(1), 1, 1e-12);
    for (int i = 0; i <= 1000; ++i) {
      const double x = i / 1000.0;
      EXPECT_NEAR(response.value_from_light(response.light_from_value(x)), x, 1e-7);
      EXPECT_NEAR(response.light_from_value(response.value_from_light(x)), x, 1e-7);
    }
    const auto table = response.table();
    for (std::size_t value = 0; value < table.size(); ++value)
      EXPECT_FLOAT_EQ(table.at(value), static_cast<float>(response.light_from_value(static_cast<double>(value) / 255)));
  }
}

// BT.709 with its three digits.
TEST(Response, HasItsKnownValues) {
  const Response linear{Response::Kind::power, 1}, rec709{Response::Kind::rec709};
  EXPECT_EQ(linear.light_from_value(0.3), 0.3);
  EXPECT_NEAR(Response{}.light_from_value(0.5), 0.21404114, 1e-8);
  EXPECT_NEAR(rec709.light_from_value(0.5), std::pow(0.599 / 1.099, 1 / 0.45), 2e-4);
  EXPECT_NEAR(rec709.value_from_light(0.01), 0.045, 1e-12);
  EXPECT_NEAR(rec709.value_from_light(0.18), 1.099 * std::pow(0.18, 0.45) - 0.099, 2e-4);
}

TEST(Response, ATableIsStraightBetweenItsPoints) {
  const Response table{Response::Kind::table, 1, {0, 0.1, 0.4, 1}, {0, 0.3, 0.7, 1}};
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_NEAR(table.light_from_value(table.table_value[i]), table.table_light[i], 1e-15);
  EXPECT_NEAR(table.light_from_value(0.5), 0.25, 1e-12);
  EXPECT_NEAR(table.value_from_light(0.7), 0.85, 1e-12);
}

}  // namespace lapservo::internal::response_test
