#pragma once

#include <optional>
#include <vector>

#include "lapservo/core/random.h"
#include "lapservo/vision/scene.h"
#include "lapservo/vision/shaft_pose.h"
#include "lapservo/vision/work_budget.h"

namespace lapservo::internal {

/// For markers that blood hides in large parts, where fitted sides and ends mislead: climbs to the configurations whose
/// predicted colours agree best with the frame, blood counting little against and colour beside the marker much. Only
/// for unknowns with an RCM. May stop after every step of a climb and go on in the next frame: the marker moves less
/// between them than a climb reaches.
class AgreementSearch {
 public:
  AgreementSearch(const PoseUnknowns& start, const Rigid3& camera_from_rcm);

  /// Goes on in this frame. Whether it came to its end; false when the budget did first.
  bool advance(const Scene& scene, WorkBudget& budget);

  /// Of a search that came to its end: up to two results (of different rotations), the best last.
  std::vector<PoseUnknowns> results() const;

  /// One of them, good to a few pixels in this frame.
  PoseUnknowns in_this_frame(const Scene& scene, const PoseUnknowns& result, WorkBudget& budget);

 private:
  // A configuration in the terms of the image: the shaft's direction turned across and along the line of sight.
  struct ImageTerms {
    Rigid3 camera_from_rcm;
    Eigen::Vector3d axis, across, away;  // in the camera
    Eigen::Vector4d values;              // turns across and away [rad], rho [m], psi [rad]

    static ImageTerms of(const Rigid3& camera_from_rcm, const PoseUnknowns& start);
    std::optional<PoseUnknowns> unknowns(const Eigen::Vector4d& at) const;
  };
  struct Climb {
    ImageTerms terms;
    Eigen::Vector4d steps;
    double score = 0;
    int halvings = 0, moves = 0;  // done; moves since the last halving
  };
  struct Result {
    double score;
    PoseUnknowns unknowns;
  };
  double score_at(const Scene& scene, const ImageTerms& terms, const Eigen::Vector4d& at, WorkBudget& budget) const;
  bool move(const Scene& scene, Climb& climb, WorkBudget& budget);
  bool finish(const Scene& scene, Climb& climb, WorkBudget& budget);

  Rigid3 camera_from_rcm_;
  PoseUnknowns start_;
  Random random_{1};
  int rotation_ = 0, frames_ = 0;
  std::optional<Climb> climb_;
  std::vector<Result> results_;
};

}  // namespace lapservo::internal
