#include "lapservo/sim_robot/sim_robot.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/io/pictures/jpeg_encoding.h"

namespace lapservo::internal {
namespace {

constexpr const char* compressed_topic = "image_raw/compressed";

ImageMessage image_of(const cv::Mat& bgr, double stamp_s) {
  ImageMessage message;
  message.stamp_s = stamp_s;
  message.width = static_cast<std::uint32_t>(bgr.cols);
  message.height = static_cast<std::uint32_t>(bgr.rows);
  message.step = 3 * message.width;
  message.encoding = "bgr8";
  const cv::Mat whole = bgr.isContinuous() ? bgr : bgr.clone();
  message.data.assign(whole.data, whole.data + whole.total() * whole.elemSize());
  return message;
}

CameraInfoMessage info_of(const Camera& camera, double stamp_s) {
  CameraInfoMessage message;
  message.stamp_s = stamp_s;
  message.width = static_cast<std::uint32_t>(camera.width_px);
  message.height = static_cast<std::uint32_t>(camera.height_px);
  message.d.assign(camera.distortion.begin(), camera.distortion.end());
  message.k = {camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1};
  return message;
}

}  // namespace

Joints default_joints() {
  return {{"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"},
          {1, -1, 1, 1},
          {0, std::numbers::pi / 2, -0.0156, 0}};
}

SimRobot::SimRobot(Transport& transport, const Rig& rig, Simulator& simulator, const SimRobotConfig& config)
    : transport_(transport),
      rig_(rig),
      simulator_(simulator),
      config_(config),
      joints_(rig.instruments.front().joints.value_or(default_joints())),
      names_(joints_.names.begin(), joints_.names.end()),
      wrist_{0.1, -0.2},
      setpoint_(simulator.measured_jp()),
      last_wanted_(setpoint_),
      now_s_(simulator.now_s()) {
  names_.insert(names_.end(), {"outer_wrist_pitch", "outer_wrist_yaw"});
  measured_js_ = transport.joint_publisher(topic_of(config.arm, "measured_js"));
  setpoint_js_ = transport.joint_publisher(topic_of(config.arm, "setpoint_js"));
  operating_state_ = transport.operating_state_publisher(topic_of(config.arm, "operating_state"));
  image_ = transport.image_publisher(topic_of(config.camera, "image_raw"));
  compressed_ = transport.compressed_image_publisher(topic_of(config.camera, compressed_topic));
  camera_info_ = transport.camera_info_publisher(topic_of(config.camera, "camera_info"));
  subscriptions_.push_back(
      transport.subscribe_joints(topic_of(config.arm, "servo_jp"), [this](JointMessage&& message) { obey(message); }));
  subscriptions_.push_back(transport.subscribe_strings(topic_of(config.arm, "state_command"),
                                                       [this](StringMessage&& message) { obey(message); }));
  compressor_ = std::thread([this] { compress(); });
}

SimRobot::~SimRobot() {
  subscriptions_.clear();
  to_compress_.cancel();
  compressor_.join();
}

void SimRobot::obey(const JointMessage& message) {
  const std::lock_guard lock(mutex_);
  const bool whole = message.positions.size() == names_.size() && (message.names.empty() || message.names == names_) &&
                     std::all_of(message.positions.begin(), message.positions.end(),
                                 [](double position) { return std::isfinite(position); });
  if (!whole) {
    ++statistics_.malformed;
    return;
  }
  if (state_ != OperatingState::enabled || !homed_) return;
  const Eigen::Vector4d q = q_from_joints(joints_, Eigen::Vector4d(message.positions.data()));
  ++statistics_.count;
  statistics_.last_s = now_s_;
  statistics_.max_step = statistics_.max_step.cwiseMax((q - last_wanted_).cwiseAbs());
  for (std::size_t i = 0; i < wrist_.size(); ++i) statistics_.wrist_moved += message.positions[4 + i] != wrist_[i];
  last_wanted_ = q;
  wanted_ = q;
}

void SimRobot::obey(const StringMessage& command) {
  const std::lock_guard lock(mutex_);
  if (command.text == "enable" || command.text == "resume") state_ = OperatingState::enabled;
  if (command.text == "disable") state_ = OperatingState::disabled;
  if (command.text == "pause") state_ = OperatingState::paused;
  if (command.text == "home") homed_ = true;
  if (command.text == "unhome") homed_ = false;
  state_changed_ = true;
}

void SimRobot::set_state(OperatingState state) {
  const std::lock_guard lock(mutex_);
  state_ = state;
  state_changed_ = true;
}

OperatingState SimRobot::operating_state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

ServoStatistics SimRobot::statistics() const {
  const std::lock_guard lock(mutex_);
  return statistics_;
}

// An arm that is not enabled wants to be where it is.
void SimRobot::apply(Eigen::Vector4d& target) {
  const std::lock_guard lock(mutex_);
  if (state_ != OperatingState::enabled) {
    target = simulator_.measured_jp();
    wanted_.reset();
    last_wanted_ = target;
  }
  if (wanted_) target = *wanted_;
}

void SimRobot::advance(double time_s) {
  stamp_at_0_s_ = transport_.stamp_now_s() - time_s;
  apply(setpoint_);
  simulator_.servo_jp(setpoint_);
  simulator_.step(std::max(0.0, time_s - simulator_.now_s()));
  {
    const std::lock_guard lock(mutex_);
    now_s_ = time_s;
  }
  if (time_s >= next_joints_s_) {
    next_joints_s_ = std::max(next_joints_s_ + 1 / config_.joint_rate_hz, time_s);
    say_joints();
  }
  if (time_s >= next_state_s_ || state_changed_) {
    next_state_s_ = time_s + config_.state_period_s;
    say_state();
  }
  say_images();
}

JointMessage SimRobot::message_of(const Eigen::Vector4d& q) const {
  const Eigen::Vector4d joints = joints_from_q(joints_, q);
  JointMessage message{transport_.stamp_now_s(), names_, {joints.data(), joints.data() + 4}};
  message.positions.insert(message.positions.end(), wrist_.begin(), wrist_.end());
  return message;
}

void SimRobot::say_joints() {
  JointMessage measured = message_of(simulator_.measured_jp());
  if (config_.alter_measured) config_.alter_measured(measured);
  measured_js_(measured);
  setpoint_js_(message_of(setpoint_));
}

void SimRobot::say_state() {
  OperatingStateMessage message;
  {
    const std::lock_guard lock(mutex_);
    state_changed_ = false;
    message = {0, std::string(to_string(state_)), homed_, false};
  }
  message.stamp_s = transport_.stamp_now_s();
  operating_state_(message);
}

void SimRobot::say_images() {
  for (const SimulatedFrame& frame : simulator_.arrived()) {
    ImageMessage message = image_of(frame.picture.bgr, stamp_at_0_s_ + frame.picture.stamp_s);
    if (config_.alter_image) config_.alter_image(message);
    camera_info_(info_of(rig_.camera, message.stamp_s));
    image_(message);
    if (!transport_.readers(topic_of(config_.camera, compressed_topic)).empty())
      to_compress_.push_over_oldest(std::move(message));
  }
}

// Beside the arm's joints, which would come late.
void SimRobot::compress() {
  constexpr int quality = 90;
  while (auto image = to_compress_.pop()) {
    const cv::Mat bgr(static_cast<int>(image->height), static_cast<int>(image->width), CV_8UC3, image->data.data(),
                      image->step);
    compressed_({image->stamp_s, "bgr8; jpeg compressed bgr8", encode_jpeg(bgr, quality)});
  }
}

}  // namespace lapservo::internal
