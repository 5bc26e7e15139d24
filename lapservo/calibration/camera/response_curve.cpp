#include "lapservo/calibration/camera/response_curve.h"

#include <cstddef>
#include <vector>

#include "lapservo/core/dense_matrix.h"

namespace lapservo::internal {
namespace {

constexpr double other_curve_sigma = 0.01;  // of a curve's numbers, beyond what usual ones are like

ResponseCurve bent_curve(const Response& base, double contrast, double middle, double shoulder) {
  const auto logistic = [&](double x) { return 1 / (1 + std::exp(-contrast * (x - middle))); };
  return nearest_curve([&](double s) {
    const double value = base.value_from_light(Response{}.light_from_value(s));
    const double bent = (logistic(value) - logistic(0)) / (logistic(1) - logistic(0));
    return bent * (1 + shoulder) / (1 + shoulder * bent);
  });
}

}  // namespace

ResponseCurve splines_at(double light) {
  ResponseCurve splines;
  for (int k = 0; k < curve_numbers; ++k) {
    const ResponseCurve unit = ResponseCurve::Unit(k);
    splines[k] = value_by_curve(unit.data(), light) - srgb_value(light);
  }
  return splines;
}

ResponseCurve nearest_curve(const std::function<double(double)>& value_of) {
  constexpr int places = 64;
  Eigen::Matrix<double, places, curve_numbers> splines;
  Eigen::Matrix<double, places, 1> beyond;
  for (int i = 0; i < places; ++i) {
    const double s = (i + 0.5) / places;
    beyond[i] = value_of(s) - s;
    splines.row(i) = splines_at(Response{}.light_from_value(s)).transpose();
  }
  const Eigen::MatrixXd across = splines.transpose();
  return solve_symmetric(product(across, splines), product(across, beyond));
}

Response table_of(const ResponseCurve& curve) {
  constexpr int steps = 64;
  Response table{Response::Kind::table, 1, {0}, {0}};
  const Response srgb;
  for (int i = 1; i <= steps; ++i) {
    const double light = i == steps ? 1 : srgb.light_from_value(static_cast<double>(i) / steps);
    const double value = i == steps ? 1 : value_by_curve(curve.data(), light);
    // Noise may bend it back where it is nearly flat.
    table.table_light.push_back(light);
    table.table_value.push_back(std::max(value, table.table_value.back() + 1e-5));
  }
  table.table_value.back() = 1;  // where those before it went beyond
  for (int i = steps - 1; i > 0 && table.table_value[static_cast<std::size_t>(i)] >= 1 - 1e-5 * (steps - i); --i)
    table.table_value[static_cast<std::size_t>(i)] = 1 - 1e-5 * (steps - i);
  return table;
}

UsualCurves usual_curves() {
  std::vector<ResponseCurve> family;
  for (const Response& base : {Response{}, Response{Response::Kind::rec709}, Response{Response::Kind::power, 1.9},
                               Response{Response::Kind::power, 2.2}})
    for (const double contrast : {0.1, 2.0, 4.0, 6.0})
      for (const double middle : {0.35, 0.45, 0.55})
        for (const double shoulder : {0.0, 0.3, 0.6}) family.push_back(bent_curve(base, contrast, middle, shoulder));
  UsualCurves usual;
  for (const ResponseCurve& curve : family) usual.mean += curve / static_cast<double>(family.size());
  Eigen::Matrix<double, curve_numbers, curve_numbers> covariance;
  covariance.setIdentity();
  covariance *= other_curve_sigma * other_curve_sigma;
  for (const ResponseCurve& curve : family)
    covariance += (curve - usual.mean) * (curve - usual.mean).transpose() / static_cast<double>(family.size());
  usual.whitening = whitening_of(covariance);
  return usual;
}

}  // namespace lapservo::internal
