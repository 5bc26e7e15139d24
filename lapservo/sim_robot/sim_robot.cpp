#include "lapservo/sim_robot/sim_robot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/sim/simulated_wrist.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

constexpr const char* compressed_topic = "image_raw/compressed";
constexpr double wrist_behind_rad = 0.02;

Tool tool_of(const Rig& rig) {
  Tool tool = rig.instruments.front().tool.value_or(Tool());
  if (tool.wrist.empty()) tool.wrist = {{.name = "outer_wrist_pitch"}, {.name = "outer_wrist_yaw"}};
  return tool;
}

std::vector<std::string> joined(const std::array<std::string, 4>& shaft, const std::vector<std::string>& wrist) {
  std::vector<std::string> names(shaft.begin(), shaft.end());
  names.insert(names.end(), wrist.begin(), wrist.end());
  return names;
}

CameraInfoMessage info_of(const Camera& camera, double stamp_s) {
  CameraInfoMessage message;
  message.frame = camera_frame;
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
      tool_(tool_of(rig)),
      arm_(transport, config.arm, joined(joints_.names, wrist_names(tool_))),
      wrist_rad_(simulated_wrist_rad(tool_, simulator.wrist_swung_rad())),
      setpoint_(simulator.measured_jp()),
      last_wanted_(setpoint_),
      image_(transport.publisher<ImageMessage>(topic_of(config.camera, "image_raw"))),
      compressed_(transport.publisher<CompressedImageMessage>(topic_of(config.camera, compressed_topic))),
      camera_info_(transport.publisher<CameraInfoMessage>(topic_of(config.camera, "camera_info"))),
      compressor_([this] { compress(); }) {}

SimRobot::~SimRobot() {
  to_compress_.cancel();
  compressor_.join();
}

void SimRobot::obey(const std::string& command) {
  const std::lock_guard lock(mutex_);
  if (command == "enable" || command == "resume") state_ = OperatingState::enabled;
  if (command == "disable") state_ = OperatingState::disabled;
  if (command == "pause") state_ = OperatingState::paused;
  if (command == "home") homed_ = true;
  if (command == "unhome") homed_ = false;
}

void SimRobot::obey(const std::vector<double>& positions) {
  const std::lock_guard lock(mutex_);
  if (state_ != OperatingState::enabled || !homed_) return;
  setpoint_ = q_from_joints(joints_, Eigen::Vector4d(positions.data()));
  ++statistics_.count;
  statistics_.max_step = statistics_.max_step.cwiseMax((setpoint_ - last_wanted_).cwiseAbs());
  for (std::size_t i = 0; i < wrist_rad_.size(); ++i)
    statistics_.wrist_moved += std::abs(positions[4 + i] - wrist_rad_[i]) > wrist_behind_rad;
  last_wanted_ = setpoint_;
}

void SimRobot::set_state(OperatingState state) {
  const std::lock_guard lock(mutex_);
  state_ = state;
}

OperatingState SimRobot::operating_state() const {
  const std::lock_guard lock(mutex_);
  return state_;
}

ServoStatistics SimRobot::statistics() const {
  const std::lock_guard lock(mutex_);
  ServoStatistics statistics = statistics_;
  statistics.malformed = arm_.malformed();
  return statistics;
}

void SimRobot::advance(double time_s) {
  stamp_at_0_s_ = transport_.stamp_now_s() - time_s;
  for (const std::string& command : arm_.new_commands()) obey(command);
  if (const auto positions = arm_.new_setpoint()) obey(*positions);
  // An arm that is not enabled wants to be where it is.
  if (operating_state() != OperatingState::enabled) last_wanted_ = setpoint_ = simulator_.measured_jp();
  simulator_.servo_jp(setpoint_);
  simulator_.step(std::max(0.0, time_s - simulator_.now_s()));
  wrist_rad_ = simulated_wrist_rad(tool_, simulator_.wrist_swung_rad());
  if (time_s >= next_joints_s_) {
    next_joints_s_ = std::max(next_joints_s_ + 1 / config_.joint_rate_hz, time_s);
    say_joints();
  }
  say_state();
  say_images();
}

JointMessage SimRobot::message_of(const Eigen::Vector4d& q) const {
  const Eigen::Vector4d joints = joints_from_q(joints_, q);
  std::vector<double> positions(joints.data(), joints.data() + 4);
  positions.insert(positions.end(), wrist_rad_.begin(), wrist_rad_.end());
  return arm_.joints(std::move(positions));
}

void SimRobot::say_joints() {
  JointMessage measured = message_of(simulator_.measured_jp());
  if (config_.alter_measured) config_.alter_measured(measured);
  arm_.say_joints(measured, message_of(setpoint_));
}

void SimRobot::say_state() {
  const std::lock_guard lock(mutex_);
  arm_.say_state({0, std::string(to_string(state_)), homed_});
}

void SimRobot::say_images() {
  for (const SimulatedFrame& frame : simulator_.arrived()) {
    ImageMessage message = bgr8_message(frame.picture.bgr, stamp_at_0_s_ + frame.picture.stamp_s);
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
    compressed_({image->stamp_s, "bgr8; jpeg compressed bgr8", encode_jpeg(bgr, quality), 0, image->frame});
  }
}

}  // namespace lapservo::internal
