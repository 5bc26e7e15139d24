#pragma once

#include <deque>

#include <Eigen/Core>

namespace lapservo::internal {

/// The joints at one image, theta, phi (rad) and rho (m): their measurement at its exposure, their speed since the
/// previous image, and the distance from there at which the image shows the instrument.
struct SeenOffset {
  double stamp_s = 0;
  Eigen::Vector3d measured = Eigen::Vector3d::Zero(), rate_per_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
};

/// Detects that the offset between images and joints changes faster than usual: an endoscope that moves slowly makes no
/// jump, but leaves its place of a moment ago. The effects of a late image, a wrong delay, motion and play are
/// subtracted first. The usual rate of change is learnt half a second later, so that the start of a motion does not
/// count as usual while it gains speed. A change in one joint alone is that joint's own play, slip or drift, and is
/// learnt at once.
class OffsetSteps {
 public:
  /// Whether it lies elsewhere than a moment ago. Images that do are compared with those before them until these are
  /// 0.1 s old; then it has to go on moving.
  bool add(const SeenOffset& now, bool delay_is_known);
  /// The next image is unrelated to the previous ones.
  void interrupt() { seen_.clear(); }
  /// Nor is what came in the last half second anything to learn from.
  void drop_latest() { interrupt(), latest_.clear(); }

 private:
  struct Seen {
    SeenOffset at;
    bool unusual = false;
    Eigen::Vector3d path = Eigen::Vector3d::Zero();  ///< that the joints have gone since the beginning, without sign
  };
  /// Statistics of one distance in time.
  struct Usual {
    Eigen::Array3d step_squared = Eigen::Array3d::Zero();
    double late_s2 = 0;
  };
  struct Change {
    Eigen::Array3d seen = Eigen::Array3d::Zero(), unexplained = Eigen::Array3d::Zero();
    Eigen::Array3d path = Eigen::Array3d::Zero();  ///< which may have to do with it
    double late_s = 0;                             ///< by which the image would have to be late or early
  };
  struct Changes {
    double stamp_s = 0;
    Change from_latest{}, from_oldest{};
  };
  Change change(const Seen& before, const Seen& now, const Usual& usual, bool delay_is_known) const;
  bool is_unusual(const Change& change, const Usual& usual) const;
  bool is_of_one_joint(const Change& change) const;
  void learn(const Changes& changes, bool delay_is_known);
  const Seen* latest(bool unusual) const;
  const Seen* oldest(bool unusual) const;

  std::deque<Seen> seen_;       ///< in order of time, of the last 0.1 s
  std::deque<Changes> latest_;  ///< not learnt yet
  Usual from_latest_, from_oldest_;
};

}  // namespace lapservo::internal
