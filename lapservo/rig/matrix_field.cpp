#include "lapservo/rig/matrix_field.h"

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/known_keys.h"

namespace lapservo::internal {

void check_shape(const YamlField& field, int rows, int columns) {
  for (const auto& [key, size] : {std::pair{"rows", rows}, {"cols", columns}})
    if (const YamlField given = field[key]; given.present() && given.number("a whole number") != size)
      given.fail(given.value_text(), std::to_string(size));
}

Eigen::MatrixXd parse_covariance(const YamlField& field, int size, std::string_view expected) {
  expect_keys(field, {{"rows", "cols", "data"}, {}});
  const auto items = field["data"].list(expected);
  if (items.size() != static_cast<std::size_t>(size) * static_cast<std::size_t>(size))
    field["data"].fail(field["data"].value_text(), expected);
  check_shape(field, size, size);
  Eigen::MatrixXd given(size, size);
  for (std::size_t i = 0; i < items.size(); ++i)
    given.reshaped()[static_cast<Eigen::Index>(i)] = items[i].number(expected);
  const Eigen::MatrixXd covariance = (given + given.transpose()) / 2;
  const double rounding = 1e-9 * covariance.cwiseAbs().maxCoeff();
  if (!((given - covariance).cwiseAbs().maxCoeff() <= rounding) ||
      !(eigenvalues_of_symmetric(covariance).minCoeff() >= -rounding))
    field.fail("not symmetric, or of negative variance", expected);
  return covariance;
}

Eigen::Quaterniond parse_unit_quaternion(const YamlField& field) {
  const auto q = field.numbers<4>("x y z w of a unit quaternion");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) < rotation_tolerance))
    field.fail("of norm " + std::to_string(rotation.norm()), "x y z w of a unit quaternion, to four digits");
  // A normalised quaternion keeps its bits, however often a rig is written and read.
  const bool unit = std::abs(rotation.squaredNorm() - 1) < 1e-14;
  return unit ? rotation : rotation.normalized();
}

}  // namespace lapservo::internal
