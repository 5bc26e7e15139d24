#include "lapservo/vision/marker_search.h"

#include <cmath>
#include <utility>

#include "lapservo/vision/coarse_fit.h"
#include "lapservo/vision/initial_pose.h"
#include "lapservo/vision/limits.h"
#include "lapservo/vision/verification.h"

namespace lapservo::internal {
namespace {

constexpr const SearchCosts& costs = search_costs;

Found refusal(Status status, const PoseUnknowns& unknowns) {
  const ShaftPose& pose = unknowns.pose();
  const bool finite = pose.camera_from_unrolled.translation.allFinite() &&
                      pose.camera_from_unrolled.rotation.coeffs().allFinite() && std::isfinite(pose.psi_rad);
  return {status, std::nullopt, finite ? std::optional(pose) : std::nullopt};
}

bool contradicts_registration(const FineFit& free) {
  const Eigen::Index psi = free.unknowns.size() - 1;
  return free.located_fraction() > registration_limits.well_seen_fraction &&
         free.psi_variance_by_print <= registration_limits.max_print_fraction * free.covariance(psi, psi);
}

Found try_start(const Scene& scene, const LightImage& light, const PoseUnknowns& start, WorkBudget& budget) {
  budget.spend(costs.coarse_fit);
  const CoarseFit coarse = fit_coarsely(scene, start, {});
  if (!coarse.found || coarse.rotation_score < detection_limits.min_rotation_score) return {};
  if (coarse.rival_score > detection_limits.rival_ratio * coarse.rotation_score)
    return refusal(Status::ambiguous, coarse.unknowns);
  budget.spend(costs.fine_fit);
  const FineFit first = fit_finely(scene, light, coarse.unknowns, {});
  const Status validated = validate(scene, first);
  if (validated == Status::ok) return {validated, first, {}};
  if (validated == Status::marker_mismatch) return refusal(validated, first.unknowns);
  budget.spend(costs.coarse_fit);
  const CoarseFit nearer = fit_coarsely(scene, coarse.unknowns, detection_limits.near_by);
  if (!nearer.found) return {};
  budget.spend(costs.fine_fit);
  const FineFit fit = fit_finely(scene, light, nearer.unknowns, {});
  const Status status = validate(scene, fit);
  return status == Status::ok ? Found{status, fit, {}} : refusal(status, fit.unknowns);
}

std::vector<PoseUnknowns> starts_in(const SearchFrame& frame, const Blob& blob,
                                    const std::optional<Rigid3>& camera_from_rcm, WorkBudget& budget) {
  budget.spend(costs.initial_poses);
  return initial_poses(frame.scene, blob, camera_from_rcm);
}

}  // namespace

Found follow(const Scene& scene, const LightImage& light, const PoseUnknowns& expected, const EdgeBlur& blur,
             const ExpectedProcessing& processing, WorkBudget& budget) {
  budget.spend(costs.fine_fit);
  const FineFit near = fit_finely(scene, light, expected, blur, processing);
  if (validate(scene, near) == Status::ok) return {Status::ok, near, {}};
  budget.spend(costs.coarse_fit);
  const CoarseFit coarse = fit_coarsely(scene, expected, detection_limits.from_memory);
  if (!coarse.found) return {};
  budget.spend(costs.fine_fit);
  const FineFit fit = fit_finely(scene, light, coarse.unknowns, blur, processing);
  const Status status = validate(scene, fit);
  return status == Status::ok ? Found{status, fit, {}} : refusal(status, fit.unknowns);
}

// The starts of one blob, until one fits. Without the RCM they are rivals: all are tried then, in one frame.
Found MarkerSearch::detect_in_blob(const SearchFrame& frame, const std::optional<Rigid3>& camera_from_rcm, Walk& walk,
                                   WorkBudget& budget) {
  Found best;
  const auto starts = starts_in(frame, frame.blobs[walk.blob], camera_from_rcm, budget);
  for (; walk.start < starts.size(); ++walk.start) {
    if (!best.fit && !budget.allows(costs.try_start())) return best;
    Found found = try_start(frame.scene, frame.light, starts[walk.start], budget);
    if (!found.fit) {
      // A print that is off is no reason to look for it elsewhere, with a boundary less.
      if (found.status == Status::marker_mismatch) return found;
      if (!best.fit && found.status != Status::no_marker) best = found;
      continue;
    }
    if (!best.fit || found.fit->inlier_rms_sigmas < best.fit->inlier_rms_sigmas) best = std::move(found);
    if (camera_from_rcm) break;  // the starts are ways to one solution
  }
  ++walk.blob, walk.start = 0;
  return best;
}

Found MarkerSearch::detect(const SearchFrame& frame, const std::optional<Rigid3>& camera_from_rcm, Walk& walk,
                           WorkBudget& budget) {
  Found best;
  while (walk.blob < frame.blobs.size()) {
    const std::size_t blob = walk.blob;
    Found found = detect_in_blob(frame, camera_from_rcm, walk, budget);
    if (found.fit || found.status == Status::marker_mismatch) return found;
    if (found.status != Status::no_marker) best = std::move(found);
    if (walk.blob == blob) return best;
  }
  walk.done = true;
  return best;
}

// Whether the marker shows in another place as well: a second print, a reflection, a picture of tiles. The RCM would
// tell which is ours.
MarkerSearch::Rival MarkerSearch::look_for_rival(const SearchFrame& frame, const FineFit& fit, Walk& walk,
                                                 WorkBudget& budget) {
  const Scene& scene = frame.scene;
  const auto middle = [&](const PoseUnknowns& unknowns) {
    const Eigen::Vector3d along(0, 0, scene.marker.length_m() / 2);
    return scene.camera.raw_from_point(unknowns.pose().camera_from_unrolled * along);
  };
  const double apart_px = detection_limits.rival_apart_radii * scene.marker.radius_m() /
                          fit.unknowns.pose().camera_from_unrolled.translation.norm() * scene.camera.fx_px;
  for (; walk.blob < frame.blobs.size(); ++walk.blob, walk.start = 0) {
    const auto starts = starts_in(frame, frame.blobs[walk.blob], std::nullopt, budget);
    for (; walk.start < starts.size(); ++walk.start) {
      const PoseUnknowns& start = starts[walk.start];
      if ((middle(start) - middle(fit.unknowns)).norm() < apart_px) continue;
      if (!budget.allows(costs.try_start())) return Rival::not_known_yet;
      const Found other = try_start(scene, frame.light, start, budget);
      if (other.status == Status::marker_mismatch) return Rival::found;
      if (other.fit && (middle(other.fit->unknowns) - middle(fit.unknowns)).norm() > apart_px) return Rival::found;
    }
  }
  return Rival::none;
}

Found MarkerSearch::without_rivals(const SearchFrame& frame, WorkBudget& budget) {
  const Rival rival = look_for_rival(frame, *candidate_, rivals_, budget);
  Found found{Status::ambiguous, std::nullopt, std::nullopt};
  if (rival == Rival::not_known_yet) return found;
  if (rival == Rival::none) found = {Status::ok, *candidate_, {}};
  *this = MarkerSearch();
  return found;
}

// The candidate as it shows in this frame, if it does.
void MarkerSearch::carry_candidate(const SearchFrame& frame, WorkBudget& budget) {
  if (!candidate_) return;
  const FineFit before = *candidate_;
  candidate_ = follow(frame.scene, frame.light, before.unknowns, before.blur, {}, budget).fit;
}

// What shows plainly, but elsewhere than the RCM allows.
Found MarkerSearch::despite_registration(const SearchFrame& frame, bool plain_is_known, WorkBudget& budget) {
  Found free = detect(frame, std::nullopt, free_, budget);
  free_.done |= free.fit || free.status == Status::marker_mismatch;
  if (!free.fit || !contradicts_registration(*free.fit)) return {};
  if (plain_is_known) return free;
  // In this frame a fit through the RCM may be possible where none was before.
  Walk again{free_.blob - 1};
  WorkBudget whole(std::nullopt);
  budget.spend(2 * costs.try_start());
  Found through_rcm = detect_in_blob(frame, frame.camera_from_rcm, again, whole);
  return through_rcm.fit || through_rcm.status == Status::marker_mismatch ? through_rcm : free;
}

// Fits to what the finished search came to.
void MarkerSearch::consider_hidden(const SearchFrame& frame, WorkBudget& budget) {
  for (const PoseUnknowns& candidate : agreement_->best(frame.scene, budget)) {
    budget.spend(costs.fine_fit);
    const FineFit fit = fit_finely(frame.scene, frame.light, candidate, {});
    if (validate(frame.scene, fit) != Status::ok) continue;
    if (!candidate_ || fit.inlier_rms_sigmas < candidate_->inlier_rms_sigmas) candidate_ = fit;
  }
}

Found MarkerSearch::hidden(const SearchFrame& frame, const Rigid3& camera_from_rcm, WorkBudget& budget) {
  for (; hidden_.blob < frame.blobs.size(); ++hidden_.blob, hidden_.start = 0) {
    const auto starts = starts_in(frame, frame.blobs[hidden_.blob], camera_from_rcm, budget);
    for (; agreement_ || hidden_.start < starts.size(); ++hidden_.start) {
      if (!agreement_) agreement_ = AgreementSearch(starts[hidden_.start], camera_from_rcm);
      if (!agreement_->advance(frame.scene, budget) || !budget.allows(costs.consider_hidden)) return {};
      consider_hidden(frame, budget);
      agreement_.reset();
    }
  }
  hidden_.done = true;
  return candidate_ ? Found{Status::ok, *candidate_, {}} : Found{};
}

Found MarkerSearch::look(const SearchFrame& frame, WorkBudget& budget) {
  carry_candidate(frame, budget);
  if (candidate_ && !frame.camera_from_rcm) return without_rivals(frame, budget);
  const bool from_the_first = plain_.blob == 0 && plain_.start == 0;
  const double fraction = searches_long_ ? search_costs.plain_fraction : 1;
  Found plain =
      budget.share(fraction, [&](WorkBudget& part) { return detect(frame, frame.camera_from_rcm, plain_, part); });
  if (plain.status == Status::marker_mismatch || (plain.fit && frame.camera_from_rcm)) {
    *this = MarkerSearch();
    return plain;
  }
  if (plain.fit) {
    candidate_ = plain.fit;
    return without_rivals(frame, budget);
  }
  const bool plain_is_known = plain_.done && from_the_first;
  if (plain.status != Status::no_marker || plain_.done) status_ = plain.status;
  plain.status = status_;
  if (plain_.done) plain_ = {}, searches_long_ = frame.camera_from_rcm.has_value();
  if (!searches_long_) return plain;
  Found found;
  if (!free_.done) found = despite_registration(frame, plain_is_known, budget);
  if (!found.fit && free_.done && found.status != Status::marker_mismatch)
    found = hidden(frame, *frame.camera_from_rcm, budget);
  if (found.fit || hidden_.done || found.status == Status::marker_mismatch) {
    *this = MarkerSearch();
    status_ = plain.status;
  }
  return found.fit || found.status == Status::marker_mismatch ? found : plain;
}

}  // namespace lapservo::internal
