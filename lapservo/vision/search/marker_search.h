#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/search/agreement_search.h"
#include "lapservo/vision/search/work_budget.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/status.h"

namespace lapservo::internal {

/// The result of looking for a marker.
struct Found {
  Status status = Status::no_marker;
  std::optional<FineFit> fit;        ///< when ok
  std::optional<ShaftPose> refused;  ///< to draw, when there was something
};

/// A frame in which one marker is looked for. Borrows everything.
struct SearchFrame {
  const Scene& scene;
  const LightImage& light;
  const std::vector<Blob>& blobs;  ///< of the whole frame, largest first

  const Rigid3& camera_from_rcm() const { return scene.registration->camera_from_rcm; }
};

/// How far a search has come through a frame's blobs and the starts of one. Where its time ends first, it goes on in
/// the frames to come, whose blobs come in about the same order.
struct BlobWalk {
  std::size_t blob = 0, start = 0;
  bool stopped = false;      ///< its time ended
  bool done = false;         ///< none is left
  bool other_bands = false;  ///< Starts, of those that were looked at

  bool begun() const { return blob > 0 || start > 0; }
  void next_blob() { ++blob, start = 0; }
};

/// The marker near where it is expected, at last without regard to the registration.
Found follow(const Scene& scene, const LightImage& light, const PoseUnknowns& start, const Expected& expected,
             WorkBudget& budget);

/// Looks for one marker all over a frame: first for what shows plainly, of a well known RCM on lines through it, else
/// by the blobs' outlines; of a well known RCM then without regard to it, and at last for markers that are hidden in
/// large parts, which takes tens of milliseconds. Work beyond the budget is done in the frames to come, from where it
/// stopped. Markers that show plainly are looked for in each of them.
class MarkerSearch {
 public:
  /// While the search goes on, the status is what it knows so far, or the last whole search came to.
  Found look(const SearchFrame& frame, WorkBudget& budget);
  /// Only for one that shows plainly and passes through the well known RCM, in another place than one that misses it.
  Found look_beside(const PoseUnknowns& missing, const SearchFrame& frame, WorkBudget& budget);

 private:
  Found look_without_rcm(const SearchFrame& frame, WorkBudget& budget);
  Found look_with_rcm(const SearchFrame& frame, WorkBudget& budget);
  Found look_long(const SearchFrame& frame, bool is_mismatch, bool plain_is_known, WorkBudget& budget);
  Found despite_registration(const SearchFrame& frame, bool plain_is_known, WorkBudget& budget);
  Found hidden(const SearchFrame& frame, WorkBudget& budget);
  bool finish_agreement(const SearchFrame& frame, WorkBudget& budget);
  bool lost_candidate(const SearchFrame& frame, WorkBudget& budget);
  void know(Found& plain);
  void begin_anew(Status status);

  Status status_ = Status::no_marker;  // of the last whole look at what shows plainly
  bool other_bands_ = false;           // that look saw bands which the marker has at no azimuth
  BlobWalk plain_, free_, hidden_;
  bool searches_long_ = false;  // what shows plainly was not found
  std::optional<AgreementSearch> agreement_;
  std::optional<FineFit> candidate_;  // the best so far, while others are looked for
  bool has_rivals_ = false;           // another rotation is as ok as the candidate's
};

}  // namespace lapservo::internal
