#include "lapservo/core/rounded_sigma.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

TEST(RoundedSigma, HasThreeDigitsAndReadsBackAsWritten) {
  EXPECT_EQ(rounded_sigma(1.23456e-7), 1.23e-7);
  EXPECT_EQ(rounded_sigma(98.76), 98.8);
  EXPECT_EQ(rounded_sigma(123456), 123000);
  EXPECT_EQ(rounded_sigma(0), 0);
  EXPECT_EQ(sigma_text(0.000123456), "0.000123");
  for (const double sigma : {3.14159e-12, 2.71828, 9.999e-5}) {
    EXPECT_NEAR(rounded_sigma(sigma) / sigma, 1, 0.005);
    EXPECT_EQ(rounded_sigma(rounded_sigma(sigma)), rounded_sigma(sigma));
    EXPECT_EQ(std::stod(sigma_text(sigma)), rounded_sigma(sigma));
  }
}

TEST(RoundedSigma, KeepsWhatIsNotFinite) {
  EXPECT_TRUE(std::isnan(rounded_sigma(std::numeric_limits<double>::quiet_NaN())));
  EXPECT_TRUE(std::isinf(rounded_sigma(std::numeric_limits<double>::infinity())));
}

}  // namespace
}  // namespace lapservo::internal
