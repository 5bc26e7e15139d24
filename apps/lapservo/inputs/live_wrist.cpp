#include "apps/lapservo/inputs/live_wrist.h"

#include <cmath>
#include <utility>

#include "apps/lapservo/inputs/transports.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::app {
using namespace internal;

LiveWrist::LiveWrist(const std::string& topic) {
  const Address address = address_of(topic, "--joints");
  transport_ = make_transport(address.transport, "lapservo_wrist", "--joints");
  subscription_ = transport_->subscribe_joints(address.name, [this](JointMessage&& message) {
    const std::lock_guard lock(mutex_);
    latest_ = std::move(message), came_s_ = clock_.now_s();
  });
}

std::vector<double> LiveWrist::newest(const Tool& tool) const {
  constexpr double too_old_s = 0.5;
  const std::lock_guard lock(mutex_);
  const std::vector<std::string> names = wrist_names(tool);
  if (names.empty() || latest_.positions.size() != latest_.names.size() || clock_.now_s() - came_s_ > too_old_s)
    return {};
  std::vector<double> readings_rad = wrist_in(latest_, names);
  for (const double reading_rad : readings_rad)
    if (!std::isfinite(reading_rad)) return {};
  return readings_rad;
}

}  // namespace lapservo::app
