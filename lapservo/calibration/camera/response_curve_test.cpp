#include "lapservo/calibration/camera/response_curve.h"

#include <gtest/gtest.h>

namespace lapservo::internal::response_curve_test {

ResponseCurve bend() {
  ResponseCurve curve;
  for (int k = 0; k < curve_numbers; ++k) curve[k] = 0.04 * std::sin(0.7 * k + 0.3);
  return curve;
}

TEST(ResponseCurve, WithoutNumbersIsSrgb) {
  const ResponseCurve none = ResponseCurve::Zero();
  for (double light = 0; light <= 1; light += 1.0 / 64)
    EXPECT_NEAR(value_by_curve(none.data(), light), Response{}.value_from_light(light), 1e-9) << light;
}

TEST(ResponseCurve, NumbersComeBackFromValues) {
  const ResponseCurve curve = bend();
  const auto value = [&](double s) { return value_by_curve(curve.data(), Response{}.light_from_value(s)); };
  EXPECT_LT((nearest_curve(value) - curve).cwiseAbs().maxCoeff(), 1e-9);
}

TEST(ResponseCurve, SplinesAreTheDerivativesByItsNumbers) {
  const ResponseCurve curve = bend();
  for (const double light : {0.002, 0.03, 0.2, 0.55, 0.97}) {
    const ResponseCurve splines = splines_at(light);
    for (int k = 0; k < curve_numbers; ++k) {
      const ResponseCurve more = curve + 1e-3 * ResponseCurve::Unit(k);
      const double slope = (value_by_curve(more.data(), light) - value_by_curve(curve.data(), light)) / 1e-3;
      EXPECT_NEAR(splines[k], slope, 1e-9) << light << ", " << k;
    }
  }
}

TEST(ResponseCurve, ATableRisesFromBlackToWhiteWhateverTheNumbers) {
  for (const double scale : {1.0, 5.0, -5.0}) {
    const Response table = table_of(scale * bend());
    EXPECT_EQ(table.table_value.front(), 0);
    EXPECT_EQ(table.table_value.back(), 1);
    for (std::size_t i = 1; i < table.table_value.size(); ++i)
      EXPECT_GT(table.table_value[i], table.table_value[i - 1]) << scale << ", " << i;
  }
}

TEST(ResponseCurve, UsualOnesAreWithinAFewSigmasOfTheirMean) {
  const UsualCurves usual = usual_curves();
  for (const Response& response : {Response{}, Response{Response::Kind::rec709}, Response{Response::Kind::power, 2}}) {
    const ResponseCurve curve =
        nearest_curve([&](double s) { return response.value_from_light(Response{}.light_from_value(s)); });
    const ResponseCurve sigmas = usual.whitening.triangularView<Eigen::Upper>() * (curve - usual.mean);
    EXPECT_LT(sigmas.cwiseAbs().maxCoeff(), 3);
  }
}

}  // namespace lapservo::internal::response_curve_test
