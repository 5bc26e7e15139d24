#pragma once

#include <deque>
#include <memory>
#include <string>

#include "apps/lapservo/cli/web_view.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/run.h"

namespace lapservo::app {

/// The page of a loop: of the instrument that is steered.
class ServoPage {
 public:
  /// `may_start`: whether a start moves an arm.
  ServoPage(const ServoOptions& options, const Rig& rig, const std::string& title, bool may_start);

  /// `state`: in words.
  void tell(const ControlTick& tick, double time_s, const std::string& state, bool can_start);
  /// Where the page wants the tip: at a pixel of an image, at the depth that the tip has there; in the frame of the
  /// loop's goals. Throws InputError where that image does not show the tip, and for a goal that is dropped.
  std::optional<TipGoal> tip_goal();
  /// The answer to goals, in words.
  void answer(double time_s, const std::string& words);
  /// Passes the page's commands on; true when one ends the run.
  bool command(Supervisor& arm, double now_s);
  /// The page's run button.
  bool operator_present() { return web_->operator_present(); }

 private:
  std::unique_ptr<WebView> web_;
  std::shared_ptr<const Rig> rig_;  ///< with the camera_from_rcm that the loop goes by
  int registration_ = 0;
  /// The tip in an image.
  struct ShownTip {
    std::optional<double> depth_m;
    Rigid3 first_from_camera;
  };
  long newest_ = 0;                               ///< number of the newest image
  std::deque<ShownTip> shown_;                    ///< the newest first
  std::optional<internal::PageWishes::Tip> tip_;  ///< as it is wanted
  std::string answer_;
};

}  // namespace lapservo::app
