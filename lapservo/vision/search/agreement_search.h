#pragma once

#include <cmath>
#include <optional>
#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/vision/search/work_budget.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How much of the frame's colours a marker in this pose explains, of which blood may hide much [px^2, about]: the area
/// that shows the colour that belongs there, less a little for what blood hides, less what contradicts: other colours,
/// and bare shaft, which has none at all, on the marker; the marker's colours beside it, and blood where bare shaft
/// should be. By area, since of shafts that lie within the colours the largest explains most. `turned`: at the pose's
/// rotation; else as at any. Only areas above `above_px2` are wanted: no_area_px2 as soon as it can't be one.
inline constexpr double no_area_px2 = -HUGE_VAL;
double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned, double above_px2 = no_area_px2);

/// For markers that blood hides in large parts, where fitted sides and ends mislead: climbs to where a marker of any
/// rotation explains most of the frame's colours (explained_area_px2()), from the start's depth and nearer ones, and
/// from there at the rotations that do. Only for unknowns with an RCM. May stop after every step of a climb and go on
/// in the next frame: the marker moves less between them than a climb reaches.
class AgreementSearch {
 public:
  AgreementSearch(const PoseUnknowns& start, const Rigid3& camera_from_rcm, double length_m);

  /// Goes on in this frame. Whether it came to its end; false when the budget did first.
  bool advance(const Scene& scene, WorkBudget& budget);

  /// After a search that came to its end: what explains most. Nullopt of a start that has no pose through the RCM.
  std::optional<PoseUnknowns> result() const;

  /// It, good to a few pixels in this frame.
  PoseUnknowns in_this_frame(const Scene& scene, const PoseUnknowns& result, WorkBudget& budget);

 private:
  // In the terms of the image: the shaft's direction turned across and along the line of sight.
  struct Climb {
    Rigid3 camera_from_rcm;
    Eigen::Vector3d axis, across, away;  // in the camera
    Eigen::Vector4d values;              // turns across and away [rad], rho [m], psi [rad]
    Eigen::Vector4d steps;               // no rotation is looked for where psi's is 0
    double score = 0;
    int halvings = 0, moves = 0;  // done; moves since the last halving

    Climb(const Rigid3& rcm_frame, const PoseUnknowns& start, const Eigen::Vector4d& first_steps);
    std::optional<PoseUnknowns> unknowns(const Eigen::Vector4d& at) const;
    bool with_rotation() const { return steps[3] > 0; }
  };
  struct Result {
    double score;
    PoseUnknowns unknowns;
  };
  double score_at(const Scene& scene, const Climb& climb, const Eigen::Vector4d& at, WorkBudget& budget,
                  double above_px2 = no_area_px2) const;
  bool move(const Scene& scene, Climb& climb, WorkBudget& budget);
  bool finish(const Scene& scene, Climb& climb, WorkBudget& budget);

  void turn(const Scene& scene, WorkBudget& budget);

  Rigid3 camera_from_rcm_;
  Random random_{1};
  int frames_ = 0;
  bool turned_ = false;         // the rotations are looked for
  std::vector<Climb> waiting_;  // the next is the last
  std::optional<Result> best_;  // of any rotation, then of those that are looked for
};

}  // namespace lapservo::internal
