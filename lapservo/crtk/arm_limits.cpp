#include "lapservo/crtk/arm_limits.h"

#include "lapservo/core/known_keys.h"
#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {
namespace {

Eigen::Vector4d four(const YamlField& field) {
  const auto values = field.numbers<4>("four numbers, one a joint", 1000, "a number within 1000");
  return Eigen::Vector4d(values.data());
}

Eigen::Vector4d four_positive(const YamlField& field) {
  const Eigen::Vector4d values = four(field);
  if (!(values.array() > 0).all()) field.fail(field.value_text(), "four numbers above 0");
  return values;
}

}  // namespace

JointLimits load_arm_limits(const std::filesystem::path& path) {
  const YamlField file = YamlField::read(path, "file of an arm's limits");
  if (!file.is_map()) file.fail(file.value_text(), "a map of lower, upper, rate and acceleration");
  expect_keys(file, {{"lower", "upper", "rate", "acceleration"}, {}});
  JointLimits limits;
  limits.lower = four(file["lower"]);
  limits.upper = four(file["upper"]);
  if (!(limits.lower.array() < limits.upper.array()).all())
    file["upper"].fail(file["upper"].value_text(), "four numbers above those of lower");
  limits.rate = four_positive(file["rate"]);
  limits.acceleration = four_positive(file["acceleration"]);
  return limits;
}

}  // namespace lapservo::internal
