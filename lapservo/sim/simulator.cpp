#include "lapservo/sim/simulator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/minimum_jerk.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/same_moment.h"
#include "lapservo/sim/simulated_wrist.h"
#include "lapservo/sim/tissue.h"

namespace lapservo {
using namespace internal;
namespace {

const Instrument& first_instrument(const Rig& rig) {
  if (rig.instruments.empty()) throw InputError("simulator", "instruments", "none", "at least one in the rig");
  if (!rig.instruments.front().camera_from_rcm)
    throw InputError("simulator", "instruments[0].camera_from_rcm", "missing",
                     "a transform: it says where the instrument is");
  return rig.instruments.front();
}

Endoscope make_endoscope(const Rig& rig, const SimulatorConfig& config) {
  const Camera& camera = rig.camera;
  const cv::Mat tissue =
      config.endoscope.pictures ? make_tissue(camera.width_px, camera.height_px, config.seed) : cv::Mat();
  ShaftModel shaft = shaft_of(first_instrument(rig));
  shaft.blotches = config.blotches;
  return Endoscope(camera, {shaft}, tissue, config.render, config.endoscope, config.seed);
}

void check_motion(bool right, const char* field, double value, const char* expected) {
  if (!right) throw InputError("endoscope motion", field, fmt::format("{}", value), expected);
}

Rigid3 camera_from_camera_before(const EndoscopeMotion& motion, double time_s) {
  const double passed_s = time_s + same_moment_s - motion.begin_s;
  if (passed_s < 0) return {};
  const double passed = passed_s < motion.duration_s ? passed_s / motion.duration_s : 1;
  const double part = motion.profile == MotionProfile::smooth ? MinimumJerk::position(passed) : passed;
  return Rigid3{rotation_by(part * motion.rotation_rad), part * motion.translation_m}.inverse();
}

}  // namespace

const EndoscopeMotion& EndoscopeMotion::checked() const {
  check_motion(begin_s >= 0 && std::isfinite(begin_s), "begin_s", begin_s, "0 or more");
  check_motion(duration_s >= 0 && std::isfinite(duration_s), "duration_s", duration_s, "0 or more");
  check_motion(translation_m.norm() <= 1, "translation_m", translation_m.norm(), "at most 1 in length");
  check_motion(rotation_rad.norm() <= 4, "rotation_rad", rotation_rad.norm(), "at most 4 in length");
  return *this;
}

Simulator::Simulator(const Rig& rig, const SimulatorConfig& config, const JointVector& q_measured)
    : Simulator(rig, config, std::make_unique<Arm>(config.arm, q_measured.vector())) {}

Simulator::Simulator(const Rig& rig, const SimulatorConfig& config, std::unique_ptr<SimulatedArm> arm)
    : camera_from_rcm_(*first_instrument(rig).camera_from_rcm *
                       Rigid3{Eigen::Quaterniond::Identity(), config.arm.rcm_offset_m}),
      arm_(std::move(arm)),
      endoscope_(make_endoscope(rig, config)),
      arm_period_s_(1 / config.arm_rate_hz),
      tool_(rig.instruments.front().tool.value_or(Tool())),
      wrist_swing_rad_(config.wrist_swing_rad) {}

JointState Simulator::state() {
  JointState state{time_s_, JointVector::from_vector(arm_->measured_jp()),
                   arm_->faulted() ? OperatingState::fault : OperatingState::enabled};
  state.wrist_rad = wrist_rad();
  return state;
}

std::vector<double> Simulator::wrist_rad() const {
  return simulated_wrist_rad(tool_, wrist_swung_rad());
}

double Simulator::wrist_swung_rad() const {
  constexpr double swing_s = 4;
  return wrist_swing_rad_ * (1 - std::cos(two_pi * time_s_ / swing_s)) / 2;
}

void Simulator::send(const JointPath& path) {
  path_ = path;
}

std::optional<StampedImage> Simulator::newest() {
  auto frames = arrived();
  if (frames.empty()) return std::nullopt;
  return StampedImage{frames.back().picture.stamp_s, std::move(frames.back().picture.bgr)};
}

void Simulator::sleep_until(double time_s) {
  while (time_s - time_s_ > same_moment_s) {
    if (arm_->faulted()) path_.reset();
    const double next_s = path_ ? std::min(time_s, time_s_ + arm_period_s_) : time_s;
    if (path_) arm_->servo_jp(path_->at(next_s).position);
    step(next_s - time_s_);
    readings_.add({time_s_, JointVector::from_vector(arm_->measured_jp())});
  }
}

ShaftPlacement Simulator::placement() const {
  const JointVector q = true_q();
  const bool covered =
      std::any_of(covered_.begin(), covered_.end(), [&](const Interval& when) { return when.contains(time_s_); });
  return {camera_from_first_camera() * camera_from_rcm_ * rcm_from_unrolled(q), q.psi_rad, covered, wrist_rad()};
}

Rigid3 Simulator::camera_from_first_camera() const {
  Rigid3 now;
  for (const EndoscopeMotion& motion : endoscope_motions_) now = camera_from_camera_before(motion, time_s_) * now;
  return now;
}

float Simulator::light_now() const {
  float light = light_;
  for (const LightChange& change : light_changes_)
    if (change.when.contains(time_s_)) light *= change.times;
  return light;
}

void Simulator::step(double dt_s) {
  if (!(dt_s >= 0 && dt_s < 1e6)) throw std::invalid_argument("time passes by 0 or more");
  const double end_s = time_s_ + dt_s;
  while (true) {
    const std::vector<double> moments_s = endoscope_.next_moments_s();
    const double next_s = moments_s[exposing_.size()];
    if (next_s > end_s + same_moment_s) break;
    arm_->step(std::max(0.0, next_s - time_s_));
    time_s_ = std::max(time_s_, next_s);
    if (exposing_.size() == moments_s.size() / 2) truth_[taken_] = true_q();
    exposing_.push_back({placement()});
    if (exposing_.size() < moments_s.size()) continue;
    endoscope_.set_light(light_now());
    endoscope_.expose(std::exchange(exposing_, {}));
    ++taken_;
  }
  arm_->step(std::max(0.0, end_s - time_s_));
  time_s_ = end_s;
}

std::vector<SimulatedFrame> Simulator::arrived() {
  std::vector<SimulatedFrame> frames;
  for (EndoscopePicture& picture : endoscope_.arrived(time_s_)) {
    const JointVector q = truth_.at(picture.index);
    truth_.erase(truth_.begin(), truth_.upper_bound(picture.index));
    frames.push_back({std::move(picture), q});
  }
  return frames;
}

}  // namespace lapservo
