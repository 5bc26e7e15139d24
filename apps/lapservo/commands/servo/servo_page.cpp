#include "apps/lapservo/commands/servo/servo_page.h"

#include <utility>

namespace lapservo::app {
using namespace internal;
namespace {

PageConfig config_of(const ServoOptions& options, const std::string& title, bool may_start) {
  PageConfig config;
  config.title = title;
  config.has_loop = may_command(options, "page");
  config.may_start = may_start;
  config.has_run_button = options.page_says_operator_present();
  return config;
}

PageLoop loop_of(const ControlTick& tick, double time_s) {
  const ControlStep& control = tick.decision.control;
  PageLoop loop;
  loop.time_s = time_s;
  loop.desired = tick.input.desired.features;
  if (control.estimate) {
    loop.error = control.error;
    loop.features = Eigen::Vector4d(tick.input.desired.features + control.error);
  }
  loop.delay_s = control.delay_s;
  loop.limited = control.limited;
  return loop;
}

}  // namespace

ServoPage::ServoPage(const ServoOptions& options, const Rig& rig, const std::string& title, bool may_start)
    : web_(options.web, config_of(options, title, may_start)), rig_(std::make_shared<const Rig>(rig)) {}

void ServoPage::tell(const ControlTick& tick, double time_s, const std::string& state, bool can_start) {
  if (tick.decision.registration != registration_) {
    Rig now = *rig_;
    now.instruments.front().camera_from_rcm = tick.decision.camera_from_rcm;
    rig_ = std::make_shared<const Rig>(std::move(now));
    registration_ = tick.decision.registration;
  }
  if (tick.seen)
    web_.show({tick.seen->image.bgr, rig_, tick.seen->observations, tick.input.time_s - tick.seen->image.time_s});
  PageLoop loop = loop_of(tick, time_s);
  loop.can_start = can_start;
  web_.tell(loop, state);
}

bool ServoPage::command(Supervisor& arm, double now_s) {
  const PageWishes wishes = web_.wishes();
  if (wishes.hold) *wishes.hold ? arm.stop(Commander::page) : arm.start(Commander::page, now_s);
  return wishes.stop;
}

}  // namespace lapservo::app
