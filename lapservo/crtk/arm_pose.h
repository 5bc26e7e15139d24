#pragma once

#include <deque>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/control/wild_readings.h"
#include "lapservo/crtk/first_sender.h"
#include "lapservo/crtk/stamp_clock.h"
#include "lapservo/crtk/transport.h"
#include "lapservo/robot/clock.h"
#include "lapservo/stream/endoscope_pose.h"

namespace lapservo::internal {

/// The pose that a CRTK arm reports: local/measured_cp, or measured_cp of an arm of which no other came within
/// FirstSender::silence_s after it; from then on the topic stays, as the other's base may be another one. Poses that
/// are not finite, or whose rotation is none, do not count, nor do those that no ECM can have reached since the last
/// one (WildReadings); while two programs publish, nobody's do.
class ArmPose {
 public:
  /// `arm`: as in CrtkRobot. The transport and the clock must outlive it.
  ArmPose(Transport& transport, const std::string& arm, const Clock& clock);

  /// nullopt while none has come, or the topic may change.
  std::optional<Rigid3> newest() const;
  /// On the clock, by stamps (StampClock): within the last 3 s interpolated, up to 0.1 s after the newest extrapolated
  /// by the motion of the last 0.05 s; else nullopt.
  std::optional<Rigid3> at(double time_s) const;
  bool has_two_senders() const;

 private:
  struct Pose {
    double time_s = 0;
    Rigid3 pose;
  };
  using WildPoses = WildReadings<6>;
  void take(const PlaceMessage& message, bool local);
  void forget();
  WildPoses::Verdict validate(const Pose& now);

  const Clock& clock_;
  mutable std::mutex mutex_;
  StampClock stamps_;
  std::deque<Pose> poses_;
  std::optional<WildPoses> wild_;                                       // since all before was forgotten
  Eigen::Quaterniond first_rotation_ = Eigen::Quaterniond::Identity();  // of then
  bool local_ = false;
  double first_s_ = std::numeric_limits<double>::infinity();  // when a pose came
  FirstSender sender_;
  std::vector<Transport::Subscription> subscriptions_;  // last: they use the others
};

/// The endoscope that such an arm holds, a dVRK's ECM for example: measured_cp is where the camera's frame lies in
/// dVRK's convention (dvrk_from_camera()).
class HeldEndoscope : public EndoscopePose {
 public:
  /// `arm` must outlive it.
  explicit HeldEndoscope(const ArmPose& arm) : arm_(arm) {}
  /// Where it is now is its first place. False, and nothing done, while the arm has reported none.
  bool begin();
  std::optional<Rigid3> first_from_camera(double time_s) const override;

 private:
  const ArmPose& arm_;
  std::optional<Rigid3> first_from_base_;
};

}  // namespace lapservo::internal
