#include "lapservo/vision/model/print_evidence.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::print_evidence_test {

PrintVector random_vector(Random& random) {
  PrintVector v;
  for (double& x : v) x = random.normal();
  return v;
}

// For so many measurements; fewer than six leave directions of which nothing is known.
PrintInformation random_information(Random& random, int measurements) {
  PrintInformation print;
  for (int i = 0; i < measurements; ++i) {
    const PrintVector row = 30 * random_vector(random);
    print.information += row * row.transpose();
    print.gradient += 30 * random.normal() * row;
  }
  return print;
}

PrintMatrix covariance_of_prior(const PrintPrior& prior) {
  PrintVector inner = PrintVector::Zero();
  inner.segment<4>(1).setConstant(prior.ink_mm);
  return prior.bands_mm * prior.bands_mm * PrintMatrix::Identity() + inner * inner.transpose();
}

TEST(PrintEvidence, OfDoubtedShapesIsThatOfALargerCovariance) {
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const PrintInformation print = random_information(random, 10);
    PrintShapes shapes;
    PrintMatrix grown = print.information.inverse();
    for (int k = 0; k < 7; ++k) {
      shapes.push_back(0.1 * random_vector(random));
      grown += shapes[static_cast<std::size_t>(k)] * shapes[static_cast<std::size_t>(k)].transpose();
    }
    const PrintInformation less = doubted(print, shapes);
    EXPECT_TRUE(less.information.isApprox(grown.inverse(), 1e-8));
    // The likeliest errors stay where they are.
    EXPECT_TRUE((grown * less.gradient).isApprox(print.information.inverse() * print.gradient, 1e-8));
  }
}

TEST(PrintEvidence, IsThatOfTheMarginalLikelihood) {
  Random random(2);
  for (const double ink_mm : {0.0, 0.04, 0.64})
    for (const double bands_mm : {0.0, 0.01, 0.16, 0.64}) {
      const PrintInformation print = random_information(random, 12);
      const PrintPrior prior{bands_mm, ink_mm};
      // Measured errors are normal: by the noise alone, or with a print of the prior beneath it.
      const PrintMatrix noise = print.information.inverse(), both = noise + covariance_of_prior(prior);
      const PrintVector measured = noise * print.gradient;
      const auto log_likelihood = [&](const PrintMatrix& covariance) {
        return -0.5 * (measured.dot(covariance.inverse() * measured) + std::log(covariance.determinant()));
      };
      const double expected = log_likelihood(both) - log_likelihood(noise);
      EXPECT_NEAR(likelihood_gain(print, prior), expected, 1e-6 * (1 + std::abs(expected)));
    }
}

TEST(PrintEvidence, CanBeHadWhereSomeErrorsDoNotShowAndIsNoneWhereNoneDoes) {
  for (const double ink_mm : {0.0, 0.3}) EXPECT_EQ(likelihood_gain({}, {0.3, ink_mm}), 0);
  Random random(3);
  for (int measurements = 1; measurements < print_errors; ++measurements) {
    const PrintInformation print = random_information(random, measurements);
    for (const double ink_mm : {0.0, 0.64}) EXPECT_TRUE(std::isfinite(likelihood_gain(print, {0.64, ink_mm})));
  }
}

TEST(PrintEvidence, AndThePriorLeaveTheirCommonCovariance) {
  Random random(4);
  for (const double ink_mm : {0.0, 0.04, 0.5})
    for (const double bands_mm : {0.02, 0.3}) {
      PrintMatrix information = PrintMatrix::Zero();
      for (const auto& [upper, lower] : errors_of_boundary)
        for (int i = 0; i < 3; ++i) {
          PrintVector row = PrintVector::Zero();
          row[upper] = 30 * random.normal(), row[lower] = 30 * random.normal();
          information += row * row.transpose();
        }
      const PrintPrior prior{bands_mm, ink_mm};
      const PrintMatrix expected = (information + covariance_of_prior(prior).inverse()).inverse();
      EXPECT_TRUE(covariance_of(information, prior).isApprox(expected, 1e-9));
    }
}

}  // namespace lapservo::internal::print_evidence_test
