#include "lapservo/core/rounded_sigma.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::rounded_sigma_test {

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

TEST(RoundedBySigma, ForgetsWhatIsFarBelowSigmaAlone) {
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const double sigma = std::pow(10, random.uniform(-9, 3)), value = random.uniform(-1e4, 1e4) * sigma;
    const double rounded = rounded_by_sigma(value, sigma);
    EXPECT_NEAR(rounded, value, 1e-4 * std::max(sigma, 1e-12)) << value << " " << sigma;
    EXPECT_EQ(rounded_by_sigma(rounded, sigma), rounded);
    EXPECT_EQ(rounded_by_sigma(rounded * (1 + 1e-14), sigma), rounded) << value << " " << sigma;
  }
  EXPECT_EQ(rounded_by_sigma(549.32232283195749, 0.031), 549.322323);
  EXPECT_EQ(rounded_by_sigma(123456.789, 3e7), 123457);
}

TEST(RoundedBySigma, KeepsWhatHasNoSigma) {
  for (const double sigma :
       {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    EXPECT_EQ(rounded_by_sigma(0.1234567890123, sigma), 0.1234567890123);
  EXPECT_TRUE(std::isnan(rounded_by_sigma(std::numeric_limits<double>::quiet_NaN(), 1)));
  EXPECT_EQ(rounded_by_sigma(1e300, 1e-300), 1e300);
}

}  // namespace lapservo::internal::rounded_sigma_test
