#include "lapservo/servo/servo_run.h"

#include <cmath>

#include "lapservo/servo/image_features.h"

namespace lapservo {
namespace {

std::optional<Eigen::Vector4d> features_at(const FeatureModel& model, const std::optional<Eigen::Vector4d>& q) {
  if (!model || !q) return std::nullopt;
  const auto state = model(*q);
  return state ? std::optional(state->features) : std::nullopt;
}

}  // namespace

void run_servo(Site& site, const ServoRunConfig& config, const Trajectory& trajectory, double duration_s,
               const AfterPeriod& after) {
  const FeatureModel model = feature_model(config.rig);
  const FeatureModel true_model = feature_model(config.true_rig ? *config.true_rig : config.rig);
  const double period_s = config.controller.period_s, start_s = site.now_s();
  Servo servo(config.controller, model);
  Tracker tracker(config.rig, config.tracker);
  const auto periods = std::lround(duration_s / period_s);
  for (long k = 0; k < periods; ++k) {
    ServoRecord record;
    record.input.time_s = site.now_s();
    record.input.arm = site.arm();
    record.input.desired = trajectory.at(record.input.time_s - start_s);
    const auto frame = site.newest_frame();
    std::vector<Observation> seen;
    if (frame) {
      seen = tracker.track(frame->bgr);
      record.input.image = measurement_of(seen[0], model, frame->stamp_s, config.rcm_px);
    }
    record.decision = servo.step(record.input);
    record.true_q = site.true_q();
    record.true_features = features_at(true_model, record.true_q);
    const bool go_on = after(record, frame ? frame->bgr : cv::Mat(), seen);
    const double next_s = start_s + static_cast<double>(k + 1) * period_s;
    record.decision.send ? site.follow(servo.path(), next_s) : site.wait(next_s);
    if (!go_on) break;
  }
  // No more velocities: the path brakes by itself.
  const double end_s = site.now_s() + stopping_time_s(config.controller.limits) + period_s;
  site.arm().state == ArmState::enabled ? site.follow(servo.path(), end_s) : site.wait(end_s);
}

std::optional<ReplayDifference> replay(const std::vector<LoggedPeriod>& log, const ServoRunConfig& config) {
  Servo servo(config.controller, feature_model(config.rig));
  for (std::size_t i = 0; i < log.size(); ++i) {
    const auto fields = decision_fields(servo.step(log[i].input));
    for (std::size_t k = 0; k < fields.size(); ++k)
      if (fields[k] != log[i].decision[k])
        return ReplayDifference{i, decision_columns()[k], log[i].decision[k], fields[k]};
  }
  return std::nullopt;
}

}  // namespace lapservo
