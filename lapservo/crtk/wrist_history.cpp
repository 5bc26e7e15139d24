#include "lapservo/crtk/wrist_history.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/crtk/joint_map.h"

namespace lapservo::internal {

void WristHistory::add(JointMessage&& message, double arrival_s) {
  while (!all_.empty() && all_.front().time_s < arrival_s - kept_s) all_.pop_front();
  if (message.positions.size() == message.names.size()) all_.push_back({arrival_s, std::move(message)});
}

std::vector<double> WristHistory::at(const std::vector<std::string>& names, double time_s) const {
  std::vector<double> nearest;
  double apart_s = near_s;
  for (const Arrived& arrived : all_) {
    if (std::abs(arrived.time_s - time_s) > apart_s) continue;
    std::vector<double> found = wrist_in(arrived.message, names);
    const auto is_finite = [](double position) { return std::isfinite(position); };
    if (found.empty() || !std::all_of(found.begin(), found.end(), is_finite)) continue;
    nearest = std::move(found), apart_s = std::abs(arrived.time_s - time_s);
  }
  return nearest;
}

}  // namespace lapservo::internal
