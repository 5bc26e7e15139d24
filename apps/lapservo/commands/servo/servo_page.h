#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/cli/web_view.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/run.h"

namespace lapservo::app {

/// The page of a loop.
class ServoPage {
 public:
  /// `may_start`: whether whoever sees the page may let the arm move.
  ServoPage(const WebOptions& options, const Rig& rig, const std::string& title, bool may_start);

  /// `state`: in words.
  void tell(const ControlTick& tick, double time_s, const std::string& state);
  internal::PageWishes wishes() { return web_.wishes(); }

 private:
  WebView web_;
  std::shared_ptr<const Rig> rig_;  ///< with the camera_from_rcm that the loop goes by
  int registration_ = 0;
};

}  // namespace lapservo::app
