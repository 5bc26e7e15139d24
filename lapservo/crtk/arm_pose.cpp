#include "lapservo/crtk/arm_pose.h"

#include <cmath>
#include <utility>

#include "lapservo/crtk/crtk_robot.h"

namespace lapservo::internal {

ArmPose::ArmPose(Transport& transport, const std::string& arm) {
  for (const bool local : {true, false})
    subscriptions_.push_back(
        transport.subscribe_places(topic_of(arm, local ? "local/measured_cp" : "measured_cp"),
                                   [this, local](PlaceMessage&& message) { take(std::move(message), local); }));
}

ArmPose::~ArmPose() {
  subscriptions_.clear();
}

void ArmPose::take(PlaceMessage&& message, bool local) {
  constexpr double plain = 1e-3;  // the norm's rounding
  Rigid3& pose = message.pose;
  if (!pose.translation.allFinite() || !(std::abs(pose.rotation.norm() - 1) < plain)) return;
  pose.rotation.normalize();
  const std::lock_guard lock(mutex_);
  if (local_ && !local) return;
  local_ = local;
  newest_ = std::move(message);
}

std::optional<PlaceMessage> ArmPose::newest() const {
  const std::lock_guard lock(mutex_);
  return newest_;
}

}  // namespace lapservo::internal
