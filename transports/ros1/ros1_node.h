#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "transports/ros1/ros1_names.h"

namespace lapservo::internal {

enum class MasterAnswer { yes, no, late };
/// Queries whether the address is a master; late: no answer within 1.5 s.
MasterAnswer ask_ros1_master(const MasterAddress& address);

/// Checks that a master answers; roscpp itself would wait for it without end. Throws InputError within 2 s, naming
/// ROS_MASTER_URI and the remedy, when nothing or something else answers.
void require_ros1_master(const MasterAddress& address);

/// This process as a node of ROS 1: one at a time, which all transports share. SIGINT stays as it is. roscpp's messages
/// go to stderr, a line each, from warnings on.
class Ros1Node {
 public:
  /// The node that is there or, where none is, a new one of that name. Throws InputError when no master answers within
  /// 2 s or a variable of the environment can't be used.
  static std::shared_ptr<Ros1Node> get(const std::string& name);
  ~Ros1Node();
  /// Whether its master answers within 1.5 s.
  bool answers() const;
  /// Unregisters what the master knows. Where the master neither answers nor refuses, for which roscpp would wait
  /// without end, it is kept for good instead.
  void end(const std::function<void()>& unregister, std::shared_ptr<void> kept);

  Ros1Node(const Ros1Node&) = delete;
  Ros1Node& operator=(const Ros1Node&) = delete;

 private:
  explicit Ros1Node(const std::string& name);
  bool master_hangs();

  MasterAddress master_;
  std::mutex mutex_;
  std::optional<bool> hangs_;  // once checked, which is at the end
};

}  // namespace lapservo::internal
