#pragma once

#include <Eigen/Core>

namespace lapservo::internal {

/// Detects measured joints that no arm can have reached since the last ones: a flipped bit, or an encoder that was set.
/// A single outlier is ignored; joints that stay three readings in a row are accepted.
class WildJoints {
 public:
  /// `rate`: the joints' largest commanded speeds; up to three times as fast is plausible, where the speed does not
  /// jump.
  explicit WildJoints(const Eigen::Vector4d& rate) : rate_(rate) {}

  enum class Verdict {
    plausible,
    wild,
    jumped,  ///< they have stayed where they seemed wild: what was measured before belongs to another place
  };
  /// Times that increase, finite joints.
  Verdict validate(double time_s, const Eigen::Vector4d& q);
  /// Whether the arm can have been there then, and its accepted place now.
  bool reaches(double time_s, const Eigen::Vector4d& q) const { return reachable({time_s, q}, believed_); }

 private:
  struct Reading {
    double time_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };
  bool reachable(const Reading& from, const Reading& to) const;
  bool goes_on(const Reading& now) const;

  Eigen::Vector4d rate_;
  Reading believed_, latest_;
  Eigen::Vector4d velocity_ = Eigen::Vector4d::Zero();  // of the accepted joints
  double interval_s_ = 0;                               // between the last two that were
  bool started_ = false;
  int staying_ = 0;  // consecutive readings that agree with each other and not with the accepted joints
};

}  // namespace lapservo::internal
