#include "transports/ros1/ros1_node.h"

#include <array>
#include <chrono>
#include <cstdio>
#include <future>
#include <memory>
#include <mutex>
#include <netdb.h>
#include <ros/console_backend.h>
#include <ros/ros.h>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include "lapservo/core/environment.h"
#include "lapservo/core/error.h"
#include "transports/ros1/ros1_names.h"

namespace lapservo::internal {
namespace {

constexpr std::chrono::milliseconds patience(1500);

std::string ask_for_its_id(const MasterAddress& address) {
  const std::string body =
      "<?xml "
      "version=\"1.0\"?><methodCall><methodName>getPid</methodName><params><param><value>/lapservo</value></param>"
      "</params></methodCall>";
  return "POST /RPC2 HTTP/1.1\r\nHost: " + address.host +
         "\r\nContent-Type: text/xml\r\nConnection: close\r\nContent-Length: " + std::to_string(body.size()) +
         "\r\n\r\n" + body;
}

bool answers(int socket, const MasterAddress& address) {
  const std::string question = ask_for_its_id(address);
  if (::send(socket, question.data(), question.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(question.size()))
    return false;
  std::string answer;
  std::array<char, 1024> part{};
  for (ssize_t count = 1; count > 0 && answer.size() < 16384;) {
    count = ::recv(socket, part.data(), part.size(), 0);
    if (count > 0) answer.append(part.data(), static_cast<std::size_t>(count));
    if (answer.find("</methodResponse>") != std::string::npos) return true;
  }
  return false;
}

// Takes as long as name servers and networks do.
bool is_master(const MasterAddress& address) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(address.host.c_str(), std::to_string(address.port).c_str(), &hints, &found) != 0) return false;
  bool is = false;
  for (const addrinfo* at = found; at && !is; at = at->ai_next) {
    const int socket = ::socket(at->ai_family, at->ai_socktype | SOCK_CLOEXEC, at->ai_protocol);
    if (socket < 0) continue;
    is = ::connect(socket, at->ai_addr, at->ai_addrlen) == 0 && answers(socket, address);
    ::close(socket);
  }
  ::freeaddrinfo(found);
  return is;
}

void say(void*, ros::console::Level level, const char* text, const char*, const char*, int) {
  if (level >= ros::console::levels::Warn) std::fprintf(stderr, "ROS: %s\n", text);
}

}  // namespace

MasterAnswer ask_ros1_master(const MasterAddress& address) {
  const auto answer = std::make_shared<std::promise<bool>>();
  auto result = answer->get_future();
  std::thread([answer, address] { answer->set_value(is_master(address)); }).detach();  // it may outlive the question
  if (result.wait_for(patience) != std::future_status::ready) return MasterAnswer::late;
  return result.get() ? MasterAnswer::yes : MasterAnswer::no;
}

void require_ros1_master(const MasterAddress& address) {
  if (ask_ros1_master(address) != MasterAnswer::yes)
    throw InputError("ROS_MASTER_URI",
                     "is " + to_string(address) +
                         ", where no ROS 1 master answers: start roscore (or rosmaster --core), or set "
                         "ROS_MASTER_URI to where it runs");
}

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
  resolved_ros1_name(name, environment("ROS_NAMESPACE"), "ROS_NAMESPACE");
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
