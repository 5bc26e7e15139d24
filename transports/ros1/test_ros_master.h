#pragma once

#include <arpa/inet.h>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "lapservo/core/error.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/temporary_folder.h"
#include "transports/ros1/ros1_node.h"

namespace lapservo::internal {

/// A socket on loopback with a port of its own. Listening, it takes connections and answers nothing.
class TestPort {
 public:
  explicit TestPort(bool listening = false) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* const generic = reinterpret_cast<sockaddr*>(&address);
    if (::bind(socket_, generic, size) == 0 && ::getsockname(socket_, generic, &size) == 0)
      number_ = ntohs(address.sin_port);
    if (listening) ::listen(socket_, 8);
  }
  ~TestPort() { ::close(socket_); }
  TestPort(const TestPort&) = delete;
  TestPort& operator=(const TestPort&) = delete;
  int number() const { return number_; }

 private:
  int socket_ = -1, number_ = 0;
};

/// ROS 1's own master, on loopback and a free port, which this process's environment names.
class TestRosMaster {
 public:
  TestRosMaster() : port_(free_port()), child_(LAPSERVO_ROSMASTER, (prepare(), command())) {
    for (const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30); !answers();) {
      if (std::chrono::steady_clock::now() > end) throw std::runtime_error("rosmaster does not start");
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  void kill() { child_.kill(); }
  /// It listens on, and answers no more.
  void stop() { child_.signal(SIGSTOP); }

 private:
  // The same each time: roscpp keeps the master that it knew first.
  static int free_port() {
    static const int port = TestPort().number();
    return port;
  }
  bool answers() const {
    try {
      require_ros1_master({"127.0.0.1", port_});
      return true;
    } catch (const InputError&) {
      return false;
    }
  }
  void prepare() const {
    ::setenv("ROS_MASTER_URI", to_string(MasterAddress{"127.0.0.1", port_}).c_str(), 1);
    ::setenv("ROS_IP", "127.0.0.1", 1);
    ::setenv("ROS_LOG_DIR", folder_.path().c_str(), 1);
    ::unsetenv("ROS_HOSTNAME");
    ::unsetenv("ROS_NAMESPACE");
  }
  std::vector<std::string> command() const { return {"--core", "-p", std::to_string(port_)}; }

  testing::TemporaryFolder folder_;
  int port_;
  testing::Process child_;
};

}  // namespace lapservo::internal
