#include "lapservo/rig/unit_quaternion.h"

#include <cmath>
#include <string>

namespace lapservo::internal {

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
