#include "apps/lapservo/commands/servo/servo_page.h"

#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr std::size_t most_shown = 3600;  // a minute's images, in which a click may be confirmed

PageConfig config_of(const ServoOptions& options, const Rig& rig, const std::string& title, bool may_start) {
  const Instrument& instrument = rig.instruments.front();
  PageConfig config;
  config.title = title;
  config.has_loop = options.may_command("page");
  config.may_start = may_start;
  config.has_run_button = options.page_says_operator_present();
  config.takes_tip_goals = config.has_loop && instrument.camera_from_rcm && instrument.tool && instrument.tool->place;
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
    : web_(open_page(options.web, config_of(options, rig, title, may_start))), rig_(std::make_shared<const Rig>(rig)) {}

void ServoPage::tell(const ControlTick& tick, double time_s, const std::string& state, bool can_start) {
  if (tick.decision.registration != registration_) {
    Rig now = *rig_;
    now.instruments.front().camera_from_rcm = tick.decision.camera_from_rcm;
    rig_ = std::make_shared<const Rig>(std::move(now));
    registration_ = tick.decision.registration;
  }
  if (tick.seen) {
    const Observation& seen = tick.seen->observations.front();
    shown_.push_front({seen.tip ? std::optional(seen.tip->camera_from_tip.translation.z()) : std::nullopt,
                       tick.seen->first_from_camera});
    if (shown_.size() > most_shown) shown_.pop_back();
    newest_ = web_->show({tick.seen->image.bgr, rig_, {seen}, tick.input.time_s - tick.seen->image.time_s});
  }
  PageLoop loop = loop_of(tick, time_s);
  loop.can_start = can_start;
  loop.answer = answer_;
  web_->tell(loop, state);
}

std::optional<TipGoal> ServoPage::tip_goal() {
  const auto wanted = std::exchange(tip_, std::nullopt);
  if (!wanted) return std::nullopt;
  if (wanted->too_late)
    throw InputError("tip_goal", "is dropped, as it took longer than a second to the loop: click again");
  const auto age = static_cast<std::size_t>(newest_ - wanted->image);
  if (age >= shown_.size()) throw InputError("tip_goal", "is dropped, as its image is too old: click again");
  const auto& [depth_m, first_from_camera] = shown_[age];
  const auto ideal_px = rig_->camera.ideal_from_raw(wanted->at_px);
  if (!ideal_px) throw InputError("tip_goal", "lies where the lens shows nothing");
  if (!depth_m) throw InputError("tip_goal", "needs the tip's depth, and that image does not show it");
  const Rigid3 now_from_camera = shown_.front().first_from_camera.inverse() * first_from_camera;
  return TipGoal{now_from_camera * Eigen::Vector3d(*depth_m * rig_->camera.ray_from_ideal(*ideal_px))};
}

void ServoPage::answer(double time_s, const std::string& words) {
  answer_ = fmt::format("{} ({:.1f} s)", words, time_s);
}

bool ServoPage::command(Supervisor& arm, double now_s) {
  const PageWishes wishes = web_->take_wishes();
  if (wishes.tip) tip_ = wishes.tip;
  if (wishes.hold) *wishes.hold ? arm.stop(Commander::page) : arm.start(Commander::page, now_s - wishes.start_age_s);
  return wishes.stop;
}

}  // namespace lapservo::app
