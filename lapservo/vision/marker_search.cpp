#include "lapservo/vision/marker_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/core/angles.h"
#include "lapservo/vision/coarse_fit.h"
#include "lapservo/vision/initial_pose.h"
#include "lapservo/vision/limits.h"
#include "lapservo/vision/verification.h"

namespace lapservo::internal {
namespace {

constexpr const SearchCosts& costs = search_costs;

bool turned_too_far(const FineFit& fit) {
  return fit.converged && fit.exposure_turn_rad > exposure_limits.max_turn_rad;
}

Found refusal(Status status, const PoseUnknowns& unknowns) {
  const ShaftPose& pose = unknowns.pose();
  const bool finite = pose.camera_from_unrolled.translation.allFinite() &&
                      pose.camera_from_unrolled.rotation.coeffs().allFinite() && std::isfinite(pose.psi_rad);
  return {status, std::nullopt, finite ? std::optional(pose) : std::nullopt};
}

// A print that is off is no reason to look for it elsewhere, with a boundary less, nor is one that turned too far, with
// its blur taken for another.
Found refusal(Status status, const FineFit& fit) {
  Found found = refusal(status, fit.unknowns);
  found.settled = status == Status::marker_mismatch || (status == Status::uncertain && turned_too_far(fit));
  return found;
}

bool contradicts_registration(const FineFit& free) {
  const Eigen::Index psi = free.unknowns.size() - 1;
  return free.located_fraction() > registration_limits.well_seen_fraction &&
         free.psi_variance_by_print <= registration_limits.max_print_fraction * free.covariance(psi, psi);
}

// The image's border hides one of the shaft's sides and a part of every boundary.
bool cut_along(const FineFit& fit) {
  constexpr double whole = 0.85;
  return *std::max_element(fit.in_image.begin(), fit.in_image.end()) < whole * fit.lines;
}

// What the model leaves out of one side, the other one doesn't balance: error / sigma was 1.7 on 80 renderings.
Found with_doubt_of_one_side(const Scene& scene, FineFit fit) {
  constexpr double doubt = 1.5;
  fit.covariance *= doubt * doubt;
  const Status status = validate(scene, fit);
  return status == Status::ok ? Found{status, std::move(fit), {}} : refusal(status, fit);
}

// A fit that is ok. One side alone holds the place of a shaft that is cut along, and where the robust loss takes that
// for an outlier at first, fits stop short of it by 20 mrad, six sigma: they go on until psi rests and the side agrees.
Found accepted(const Scene& scene, const LightImage& light, FineFit fit, WorkBudget& budget) {
  if (!cut_along(fit)) return {Status::ok, std::move(fit), {}};
  constexpr int most = 4;
  constexpr double rest_sigmas = 0.2, least_sides = 0.8;
  for (int i = 0; i < most; ++i) {
    const double before_rad = fit.unknowns.pose().psi_rad;
    budget.spend(costs.fine_fit);
    fit = fit_finely(scene, light, fit.unknowns, fit.blur);
    if (const Status status = validate(scene, fit); status != Status::ok) return refusal(status, fit);
    const Eigen::Index psi = fit.unknowns.size() - 1;
    const double moved_rad = std::abs(wrap_pi(fit.unknowns.pose().psi_rad - before_rad));
    if (moved_rad < rest_sigmas * std::sqrt(fit.covariance(psi, psi)) &&
        fit.sides_used >= least_sides * fit.sides_in_image)
      return with_doubt_of_one_side(scene, fit);
  }
  return refusal(Status::uncertain, fit);
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
  if (validated == Status::ok) return accepted(scene, light, first, budget);
  if (Found refused = refusal(validated, first); refused.settled) return refused;
  budget.spend(costs.coarse_fit);
  const CoarseFit nearer = fit_coarsely(scene, coarse.unknowns, detection_limits.near_by);
  if (!nearer.found) return {};
  budget.spend(costs.fine_fit);
  const FineFit fit = fit_finely(scene, light, nearer.unknowns, {});
  const Status status = validate(scene, fit);
  return status == Status::ok ? accepted(scene, light, fit, budget) : refusal(status, fit);
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
  const Status nearby = validate(scene, near);
  if (nearby == Status::ok) return accepted(scene, light, near, budget);
  if (nearby == Status::uncertain && turned_too_far(near)) return refusal(nearby, near);
  budget.spend(costs.coarse_fit);
  const CoarseFit coarse = fit_coarsely(scene, expected, detection_limits.from_memory);
  if (!coarse.found) return {};
  budget.spend(costs.fine_fit);
  const FineFit fit = fit_finely(scene, light, coarse.unknowns, blur, processing);
  const Status status = validate(scene, fit);
  return status == Status::ok ? accepted(scene, light, fit, budget) : refusal(status, fit);
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
      if (found.settled) return found;
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
    if (found.fit || found.settled) return found;
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
      if (other.settled) return Rival::found;
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
  free_.done |= free.fit || free.settled;
  if (!free.fit || !contradicts_registration(*free.fit)) return {};
  if (plain_is_known) return free;
  // In this frame a fit through the RCM may be possible where none was before.
  Walk again{free_.blob - 1};
  WorkBudget whole(std::nullopt);
  budget.spend(2 * costs.try_start());
  Found through_rcm = detect_in_blob(frame, frame.camera_from_rcm, again, whole);
  return through_rcm.fit || through_rcm.settled ? through_rcm : free;
}

// False when the budget ends first.
bool MarkerSearch::fit_to_results(const SearchFrame& frame, WorkBudget& budget) {
  if (!results_) results_ = agreement_->results();
  for (; !results_->empty(); results_->pop_back()) {
    if (!budget.allows(costs.fit_to_result)) return false;
    budget.spend(costs.fit_to_result);
    const PoseUnknowns start = agreement_->in_this_frame(frame.scene, results_->back(), budget);
    const FineFit first = fit_finely(frame.scene, frame.light, start, {});
    if (validate(frame.scene, first) != Status::ok) continue;
    const Found found = accepted(frame.scene, frame.light, first, budget);
    if (!found.fit) continue;
    if (!candidate_ || found.fit->inlier_rms_sigmas < candidate_->inlier_rms_sigmas) candidate_ = found.fit;
  }
  results_.reset();
  return true;
}

Found MarkerSearch::hidden(const SearchFrame& frame, const Rigid3& camera_from_rcm, WorkBudget& budget) {
  for (; hidden_.blob < frame.blobs.size(); ++hidden_.blob, hidden_.start = 0) {
    const auto starts = starts_in(frame, frame.blobs[hidden_.blob], camera_from_rcm, budget);
    for (; agreement_ || hidden_.start < starts.size(); ++hidden_.start) {
      if (!agreement_) agreement_ = AgreementSearch(starts[hidden_.start], camera_from_rcm);
      if (!agreement_->advance(frame.scene, budget) || !fit_to_results(frame, budget)) return {};
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
  // Half the budget, or by turns what a start takes, is for what shows plainly.
  longs_turn_ = searches_long_ && !longs_turn_;
  const double half = budget.left() / 2, one_start = costs.initial_poses + costs.try_start();
  const double share = !searches_long_ ? budget.left() : longs_turn_ ? half : std::max(half, one_start);
  Found plain = budget.share(share, !longs_turn_,
                             [&](WorkBudget& part) { return detect(frame, frame.camera_from_rcm, plain_, part); });
  budget.set_free_step(longs_turn_);
  if (plain.settled || (plain.fit && frame.camera_from_rcm)) {
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
  if (!found.fit && free_.done && !found.settled) found = hidden(frame, *frame.camera_from_rcm, budget);
  if (found.fit || hidden_.done || found.settled) {
    *this = MarkerSearch();
    status_ = plain.status;
  }
  return found.fit || found.settled ? found : plain;
}

}  // namespace lapservo::internal
