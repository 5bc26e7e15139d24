#include "lapservo/crtk/joint_map.h"

#include <algorithm>

namespace lapservo::internal {

JointLimits limits_of_q(const Joints& joints, const JointLimits& limits) {
  const Eigen::Vector4d a = q_from_joints(joints, limits.lower), b = q_from_joints(joints, limits.upper);
  JointLimits of_q = limits;
  of_q.lower = a.cwiseMin(b);
  of_q.upper = a.cwiseMax(b);
  return of_q;
}

std::optional<std::array<std::size_t, 4>> find_joints(const Joints& joints, const std::vector<std::string>& names) {
  std::array<std::size_t, 4> places{};
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto found = std::find(names.begin(), names.end(), joints.names[i]);
    if (found == names.end() || std::find(found + 1, names.end(), joints.names[i]) != names.end()) return std::nullopt;
    places[i] = static_cast<std::size_t>(found - names.begin());
  }
  return places;
}

}  // namespace lapservo::internal
