#pragma once

#include <memory>
#include <string>

namespace lapservo::internal {

/// This process as a node of ROS 1: one at a time, which all transports share. SIGINT stays as it is. What roscpp has
/// to say is said on stderr, a line each, from warnings on.
class Ros1Node {
 public:
  /// The node that is there or, where none is, a new one of that name. Throws InputError when no master answers within
  /// 2 s or a variable of the environment can't be used.
  static std::shared_ptr<Ros1Node> get(const std::string& name);
  ~Ros1Node();
  Ros1Node(const Ros1Node&) = delete;
  Ros1Node& operator=(const Ros1Node&) = delete;

 private:
  explicit Ros1Node(const std::string& name);
};

}  // namespace lapservo::internal
