#include "lapservo/crtk/arm_limits.h"

#include "lapservo/core/joint_units.h"
#include "lapservo/core/known_keys.h"
#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {
namespace {

Eigen::Vector4d four(const YamlField& field, const JointUnits& units) {
  const auto values = field.numbers<4>("four numbers, one a joint", 1000, "a number within 1000");
  expect_radians_and_metres(field, values, units);
  return Eigen::Vector4d(values.data());
}

Eigen::Vector4d four_positive(const YamlField& field, const JointUnits& units) {
  const Eigen::Vector4d values = four(field, units);
  if (!(values.array() > 0).all()) field.fail(field.value_text(), "four numbers above 0");
  return values;
}

}  // namespace

JointLimits load_arm_limits(const std::filesystem::path& path) {
  const YamlField file = YamlField::read(path, "file of an arm's limits");
  if (!file.is_map()) file.fail(file.value_text(), "a map of lower, upper, rate and acceleration");
  expect_keys(file, {{"lower", "upper", "rate", "acceleration"}, {}});
  JointLimits limits;
  limits.lower = four(file["lower"], joint_positions);
  limits.upper = four(file["upper"], joint_positions);
  if (!(limits.lower.array() < limits.upper.array()).all())
    file["upper"].fail(file["upper"].value_text(), "four numbers above those of lower");
  limits.rate = four_positive(file["rate"], joint_rates);
  limits.acceleration = four_positive(file["acceleration"], joint_accelerations);
  return limits;
}

}  // namespace lapservo::internal
