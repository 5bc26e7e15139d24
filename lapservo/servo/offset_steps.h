#pragma once

#include <deque>

#include <Eigen/Core>

namespace lapservo::internal {

/// The joints at one image, theta, phi (rad) and rho (m): their measurement at its exposure, their speed since the
/// previous image, and the distance from there at which the image shows the instrument. Fourth: by how much the image
/// misfits any joints (rad), since the shaft does not pass the RCM.
struct SeenOffset {
  double stamp_s = 0;
  Eigen::Vector4d measured = Eigen::Vector4d::Zero(), rate_per_s = Eigen::Vector4d::Zero();
  Eigen::Vector4d offset = Eigen::Vector4d::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< of the offset, by the image's noise
};

/// Detects that the offset between images and joints changes faster than usual: an endoscope that moves slowly makes no
/// jump, but leaves its place of a moment ago. The effects of a late image, a wrong delay, motion and play are
/// subtracted first. The usual rate of change is learnt half a second later, so that the start of a motion does not
/// count as usual while it gains speed. A change in one joint alone is that joint's own play, slip or drift, and is
/// learnt at once.
class OffsetSteps {
 public:
  /// Whether it lies elsewhere than a moment ago: than in the images of the last 0.1 s, and in the one before where
  /// that is not 0.2 s old. Images that do are compared with those before them until these are as old; then it has to
  /// go on moving.
  bool add(const SeenOffset& now, bool delay_is_known);
  /// The next image is unrelated to the previous ones.
  void interrupt() { seen_.clear(); }
  /// Nor is what came in the last half second anything to learn from.
  void drop_latest() { interrupt(), latest_.clear(); }

 private:
  struct Seen {
    SeenOffset at;
    bool unusual = false;
    Eigen::Vector4d path = Eigen::Vector4d::Zero();  ///< that the joints have gone since the beginning, without sign
  };
  struct Change {
    double stamp_s = 0;
    Eigen::Array4d seen = Eigen::Array4d::Zero(), unexplained = Eigen::Array4d::Zero();
    Eigen::Array4d path = Eigen::Array4d::Zero();  ///< which may have to do with it
    double late_s = 0;                             ///< by which the image is late or early, as likely as not
    double sigmas = 0;                             ///< size of the step in units of its sigmas
  };
  Change change(const Seen& before, const Seen& now, bool delay_is_known) const;
  bool is_of_one_joint(const Change& change) const;
  void learn(const Change& change, bool delay_is_known);
  const Seen& oldest() const;

  std::deque<Seen> seen_;                                 ///< in order of time, those to compare with
  std::deque<Change> latest_;                             ///< not learnt yet
  Eigen::Array4d step_squared_ = Eigen::Array4d::Zero();  ///< the usual one
  double late_s2_ = 0;
};

}  // namespace lapservo::internal
