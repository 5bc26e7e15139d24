#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/trajectory.h"
#include "lapservo/core/bounded_queue.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/loop_topics/frame_topics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/robot/suspension_watch.h"
#include "lapservo/servo/run.h"

namespace lapservo::internal {

/// Commands of other programs to the loop.
struct LoopWishes {
  struct Start {
    double said_s = 0;         ///< when it came, on SteadyClock
    bool force = false;        ///< whoever holds
    std::uint64_t source = 0;  ///< who said it
  };
  std::set<std::uint64_t> stops;  ///< who said them
  std::vector<Start> starts;
  std::set<std::string> remarks;             ///< on what did not count, in words
  std::optional<Eigen::Vector4d> set_point;  ///< s_rad, r_px, l_px, d_px
  std::optional<TipGoal> tip_goal;
  std::optional<Trajectory> trajectory;  ///< of time since it is begun; of these three the last
};

/// The loop's topics for those who watch and command it, of the rig's first instrument NAME:
/// /lapservo/NAME/observation (lapservo_msgs/Observation) and FrameTopics of every image, with an RCM frame that may
/// move; /lapservo/NAME/desired and
/// /lapservo/NAME/error (JointState: s_rad, r_px, l_px, d_px) every tick; /diagnostics (DiagnosticArray) once a second
/// and when something changes; /lapservo/NAME/overlay/compressed, drawn in a thread of its own, at most ten a second.
/// It hears /lapservo/NAME/command (StringStamped: start, start force; any other word stops), /lapservo/NAME/set_point
/// (JointState: s_rad, r_px, l_px, d_px), /lapservo/NAME/tip_goal (PoseStamped of the tip in the camera's frame; an
/// orientation of (0, 0, 0, 1) or of zeros, which messages have where nobody sets it, leaves the roll free) and
/// /lapservo/NAME/trajectory (JointTrajectory of the four, or of x_m, y_m, z_m and roll_rad or without). Goals of the
/// tip have the camera frame's name or none as their frame; others are refused. A start that is repeated counts once:
/// it would start the arm by itself after each hold. Latched starts and goals do not count, with a remark, until 1.5 s
/// after the first call of wishes(), nor where their sender was connected before.
class LoopTopics {
 public:
  /// `hears`: whether it hears anything; else it only publishes.
  LoopTopics(Transport& transport, const Rig& rig, const FrameNames& frames, bool hears = true);
  ~LoopTopics();

  /// `state`: the loop's, in words; empty where it tracks.
  void publish(const ControlTick& tick, const std::string& state);
  /// Whether another loop has published as NAME in the last second: it would obey the same commands.
  bool name_is_in_use() const;
  /// Messages since the last call, of which every tick has one. Dropped, with a remark, are goals that are none, and
  /// starts and goals that may have been kept back: until 1.5 s after the arm, which was heard last at `arm_heard_s` on
  /// SteadyClock, was silent or the calls were apart for more than 0.5 s, or the computer was suspended. A stop counts
  /// whenever it comes.
  LoopWishes wishes(double arm_heard_s);

 private:
  void publish_numbers(const ControlTick& tick, double stamp_s);
  void publish_observation(const ControlTick& tick, double stamp_s);
  void publish_state(const ControlTick& tick, const std::string& state, double stamp_s);
  void hear_wishes();
  void hear(const StringMessage& command);
  void hear_start(const StringMessage& command, bool force);
  template <typename Message, typename Goal>
  void hear_goals(const char* name, Goal (*goal_of)(const Message&, const std::string& camera),
                  std::optional<Goal> LoopWishes::*wish);
  bool is_of_before(Latched latched);
  void remark(const std::string& text);
  bool may_be_old(double arm_heard_s);
  void draw();

  struct Drawing {
    double stamp_s = 0;
    cv::Mat bgr;
    std::vector<Observation> observations;  // of the instrument that is steered
    std::optional<Rigid3> camera_from_rcm;
  };

  Transport& transport_;
  Rig rig_;
  std::string last_state_;
  double next_state_s_ = 0;
  SteadyClock clock_;
  SuspensionWatch suspension_{clock_};
  std::optional<double> called_s_;  // when wishes() was called last
  double interrupted_s_;            // when it may have been deaf last
  Transport::Publisher<ObservationMessage> observation_;
  FrameTopics frames_;
  Transport::Publisher<JointMessage> desired_, error_;
  Transport::Publisher<DiagnosticMessage> diagnostics_;
  Transport::Publisher<CompressedImageMessage> overlay_;

  mutable std::mutex mutex_;
  LoopWishes wishes_;
  double begun_s_;                   ///< when wishes() was called first
  std::array<double, 2> started_s_;  ///< when start, and start force, came last
  double other_loop_s_;              ///< when another one of this name published last
  BoundedQueue<Drawing> to_draw_{1};
  double next_drawing_s_ = 0;
  std::vector<Transport::Subscription> subscriptions_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace lapservo::internal
