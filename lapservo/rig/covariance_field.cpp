#include "lapservo/rig/covariance_field.h"

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

}  // namespace lapservo::internal
