#include "lapservo/geometry/response.h"

#include <vector>

#include <gtest/gtest.h>

namespace lapservo {
namespace {

std::vector<Response> responses() {
  return {{}, {Response::Kind::power, 1}, {Response::Kind::power, 2.2}, {Response::Kind::power, 0.45}};
}

TEST(Response, ValueAndLightRoundTrip) {
  for (const Response& response : responses())
    for (int i = 0; i <= 1000; ++i) {
      const double x = i / 1000.0;
      EXPECT_NEAR(response.value_from_light(response.light_from_value(x)), x, 1e-7);
      EXPECT_NEAR(response.light_from_value(response.value_from_light(x)), x, 1e-7);
    }
}

TEST(Response, IsStrictlyMonotonicFromZeroToOne) {
  for (const Response& response : responses()) {
    EXPECT_EQ(response.light_from_value(0), 0);
    EXPECT_NEAR(response.light_from_value(1), 1, 1e-12);
    for (int i = 1; i <= 1000; ++i)
      EXPECT_GT(response.light_from_value(i / 1000.0), response.light_from_value((i - 1) / 1000.0));
  }
}

TEST(Response, LinearIsTheIdentityAndSrgbHasItsKnownMiddle) {
  const Response linear{Response::Kind::power, 1};
  EXPECT_EQ(linear.light_from_value(0.3), 0.3);
  EXPECT_NEAR(Response{}.light_from_value(0.5), 0.21404114, 1e-8);
}

TEST(Response, TheTableHoldsTheLightOfEachValue) {
  for (const Response& response : responses()) {
    const auto table = response.table();
    for (std::size_t value = 0; value < table.size(); ++value)
      EXPECT_FLOAT_EQ(table.at(value), static_cast<float>(response.light_from_value(static_cast<double>(value) / 255)));
  }
}

}  // namespace
}  // namespace lapservo
