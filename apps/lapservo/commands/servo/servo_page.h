#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/cli/web_view.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/run.h"

namespace lapservo::app {

/// The page of a loop.
class ServoPage {
 public:
  /// Whether whoever sees the page may hold and start the loop, and whether a start moves an arm.
  ServoPage(const WebOptions& options, const Rig& rig, const std::string& title, bool may_command, bool may_start);

  /// `state`: in words.
  void tell(const ControlTick& tick, double time_s, const std::string& state);
  /// Passes the page's commands on; true when one ends the run.
  bool command(Supervisor& arm, double now_s);

 private:
  WebView web_;
  std::shared_ptr<const Rig> rig_;  ///< with the camera_from_rcm that the loop goes by
  int registration_ = 0;
};

}  // namespace lapservo::app
