#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

/// The pose that a CRTK arm reports: local/measured_cp, or measured_cp of an arm that has no other.
class ArmPose {
 public:
  /// `arm`: as in CrtkRobot. The transport must outlive it.
  ArmPose(Transport& transport, const std::string& arm);
  ~ArmPose();

  /// The newest; nullopt while none has come. One that is not finite or whose rotation is none does not count.
  std::optional<PlaceMessage> newest() const;

 private:
  void take(PlaceMessage&& message, bool local);

  mutable std::mutex mutex_;
  std::optional<PlaceMessage> newest_;
  bool local_ = false;
  std::vector<Transport::Subscription> subscriptions_;  // last: they use the others
};

}  // namespace lapservo::internal
