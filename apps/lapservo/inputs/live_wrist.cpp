#include "apps/lapservo/inputs/live_wrist.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/transports.h"

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
  const auto joints = tool.wrist.empty() ? std::nullopt : wrist_joints(tool, latest_.names);
  if (!joints || latest_.positions.size() != latest_.names.size() || clock_.now_s() - came_s_ > too_old_s) return {};
  std::vector<double> readings_rad;
  for (std::size_t i = 0; i < tool.wrist.size(); ++i) {
    const auto found = std::find(latest_.names.begin(), latest_.names.end(), joints->names[i]);
    readings_rad.push_back(latest_.positions[static_cast<std::size_t>(found - latest_.names.begin())]);
    if (!std::isfinite(readings_rad.back())) return {};
  }
  return readings_rad;
}

}  // namespace lapservo::app
