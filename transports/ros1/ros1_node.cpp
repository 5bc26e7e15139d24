#include "transports/ros1/ros1_node.h"

#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <ros/console_backend.h>
#include <ros/ros.h>
#include <utility>
#include <vector>

#include "lapservo/core/error.h"
#include "transports/ros1/ros1_master.h"
#include "transports/ros1/ros1_names.h"

namespace lapservo::internal {
namespace {

std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : "";
}

void say(void*, ros::console::Level level, const char* text, const char*, const char*, int) {
  if (level >= ros::console::levels::Warn) std::fprintf(stderr, "ROS: %s\n", text);
}

}  // namespace

std::shared_ptr<Ros1Node> Ros1Node::get(const std::string& name) {
  static std::mutex mutex;
  static std::weak_ptr<Ros1Node> node;
  const std::lock_guard lock(mutex);
  if (auto there = node.lock()) return there;
  const std::shared_ptr<Ros1Node> made(new Ros1Node(name));
  node = made;
  return made;
}

// Checks beforehand the errors at which roscpp ends the process or waits without end.
Ros1Node::Ros1Node(const std::string& name) : master_(master_address(environment("ROS_MASTER_URI"))) {
  resolved_ros1_name(name, ros1_namespace(), "ROS_NAMESPACE");
  require_ros1_master(master_);
  ros::console::initialize();
  ros::console::backend::function_print = say;
  ros::init(ros::M_string{{"__master", to_string(master_)}}, name,
            ros::init_options::NoSigintHandler | ros::init_options::NoRosout);
  ros::master::setRetryTimeout(ros::WallDuration(2));
  ros::start();
  if (!ros::ok()) throw InputError("ROS_MASTER_URI", "is " + to_string(master_) + ", where no node can be started");
}

Ros1Node::~Ros1Node() {
  if (!master_hangs()) ros::shutdown();
}

bool Ros1Node::answers() const {
  return ask_ros1_master(master_) == MasterAnswer::yes;
}

bool Ros1Node::master_hangs() {
  const std::lock_guard lock(mutex_);
  if (!hangs_) hangs_ = ask_ros1_master(master_) == MasterAnswer::late;
  return *hangs_;
}

void Ros1Node::end(const std::function<void()>& unregister, std::shared_ptr<void> kept) {
  if (!master_hangs()) return unregister();
  static auto& for_good = *new std::vector<std::shared_ptr<void>>;
  const std::lock_guard lock(mutex_);
  for_good.push_back(std::move(kept));
}

}  // namespace lapservo::internal
