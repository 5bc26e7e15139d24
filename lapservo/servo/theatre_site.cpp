#include "lapservo/servo/theatre_site.h"

#include <algorithm>
#include <utility>

namespace lapservo {
namespace {

constexpr double least_step_s = 1e-9;  // below it, time has come

}  // namespace

ArmReading TheatreSite::arm() const {
  return {theatre_.measured_jp(), theatre_.arm().faulted() ? ArmState::fault : ArmState::enabled};
}

std::optional<SiteFrame> TheatreSite::newest_frame() {
  auto frames = theatre_.arrived();
  if (frames.empty()) return std::nullopt;
  return SiteFrame{frames.back().picture.stamp_s, std::move(frames.back().picture.bgr)};
}

void TheatreSite::follow(const SetpointInterpolator& path, double until_s) {
  while (until_s - now_s() > least_step_s) {
    const double next_s = std::min(until_s, now_s() + arm_period_s_);
    theatre_.servo_jp(path.at(next_s).position);
    theatre_.step(next_s - now_s());
  }
}

void TheatreSite::wait(double until_s) {
  if (until_s > now_s()) theatre_.step(until_s - now_s());
}

}  // namespace lapservo
