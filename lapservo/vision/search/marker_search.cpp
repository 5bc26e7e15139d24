#include "lapservo/vision/search/marker_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/vision/decision/verification.h"
#include "lapservo/vision/search/coarse_fit.h"
#include "lapservo/vision/search/starts.h"

namespace lapservo::internal {
namespace {

constexpr const SearchCosts& costs = search_costs;

Found refusal(Status status, const PoseUnknowns& unknowns) {
  const ShaftPose& pose = unknowns.pose();
  const bool finite = pose.camera_from_unrolled.translation.allFinite() &&
                      pose.camera_from_unrolled.rotation.coeffs().allFinite() && std::isfinite(pose.psi_rad);
  return {status, std::nullopt, finite ? std::optional(pose) : std::nullopt};
}

CoarseFit fitted_coarsely(const Scene& scene, const PoseUnknowns& start, Rotation rotation, WorkBudget& budget) {
  const CoarseFit fit = fit_coarsely(scene, start, rotation);
  budget.spend(fit.found ? costs.coarse_fit : costs.no_coarse_fit);
  return fit;
}

FineFit fitted(const Scene& scene, const LightImage& light, const PoseUnknowns& start, const Expected& expected,
               WorkBudget& budget) {
  FineFit fit = fit_finely(scene, light, start, expected);
  budget.spend(fit.passes * costs.fine_pass + (fit.converged ? costs.fine_end : 0) +
               fit.processing_explained * costs.processing + fit.asked_for_departure * costs.departure);
  return fit;
}

// A fit is ok unless it is refused or a boundary shows elsewhere.
Found judged(const Scene& scene, const LightImage& light, FineFit fit, WorkBudget& budget) {
  Status status = validate(scene, fit);
  if (status == Status::ok && may_be_displaced(fit)) {
    budget.spend(costs.fine_pass);
    if (is_displaced(scene, light, fit)) status = Status::marker_mismatch;
  }
  return status == Status::ok ? Found{status, std::move(fit), {}} : refusal(status, fit.unknowns);
}

Found fitted_from(const Scene& scene, const LightImage& light, const PoseUnknowns& start, const Expected& expected,
                  WorkBudget& budget) {
  return judged(scene, light, fitted(scene, light, start, expected, budget), budget);
}

Found try_start(const Scene& scene, const LightImage& light, const PoseUnknowns& start, WorkBudget& budget) {
  const CoarseFit coarse = fitted_coarsely(scene, start, Rotation::unknown, budget);
  if (!coarse.shows_rotation()) return {};
  if (coarse.has_rival()) return refusal(Status::ambiguous, coarse.unknowns);
  FineFit fit = fitted(scene, light, coarse.unknowns, {}, budget);
  if (!fit.converged)
    if (const CoarseFit nearer = fitted_coarsely(scene, coarse.unknowns, Rotation::known, budget); nearer.found)
      fit = fitted(scene, light, nearer.unknowns, {}, budget);
  return judged(scene, light, std::move(fit), budget);
}

// Two fits of one marker that are both ok: of what blood leaves both can't be sure.
bool are_rivals(const FineFit& fit, const FineFit& other) {
  return std::abs(fit.unknowns.change_to(other.unknowns)[psi_unknown]) > Observation::false_rad;
}

double cost_of_starts(const SearchFrame& frame, bool through_rcm) {
  return (frame.scene.others.empty() ? 1 : 2) * (through_rcm ? costs.starts : costs.free_starts);
}

Starts starts_in(const SearchFrame& frame, bool through_rcm, const Blob& blob, WorkBudget& budget) {
  Starts starts =
      starts_in(frame.scene, blob, through_rcm ? std::optional(frame.camera_from_rcm()) : std::optional<Rigid3>());
  budget.spend(starts.poses.empty() ? costs.no_starts : cost_of_starts(frame, through_rcm));
  return starts;
}

// The starts of the next blob, until one fits. Rivals are all tried, in one frame.
Found detect_in_blob(const SearchFrame& frame, bool through_rcm, BlobWalk& walk, WorkBudget& budget) {
  Found best;
  bool has_rivals = false;
  const std::size_t first = walk.start;
  walk.stopped = !budget.allows(cost_of_starts(frame, through_rcm) + costs.try_start());
  if (walk.stopped) return best;
  const auto [starts, rivals, other_bands] = starts_in(frame, through_rcm, frame.blobs[walk.blob], budget);
  walk.other_bands |= other_bands;
  for (std::size_t i = first; i < starts.size() && (i < rivals || !best.fit); ++i) {
    walk.start = i;
    walk.stopped = i > first && i >= rivals && !budget.allows(costs.try_start());
    if (walk.stopped) return best;
    Found found = try_start(frame.scene, frame.light, starts[i], budget);
    if (!found.fit) {
      // A misprint is no reason to look for the marker elsewhere, with a boundary less.
      if (found.status == Status::marker_mismatch) return found;
      if (!best.fit && best.status == Status::no_marker) best = found;  // the likeliest start's refusal stays
      continue;
    }
    has_rivals |= best.fit && are_rivals(*best.fit, *found.fit);
    if (!best.fit || found.fit->misfit() < best.fit->misfit()) best = std::move(found);
  }
  return has_rivals ? refusal(Status::ambiguous, best.fit->unknowns) : best;
}

// Places within a radius are one.
bool are_apart(const Scene& scene, const PoseUnknowns& one, const PoseUnknowns& other) {
  const auto middle = [&](const PoseUnknowns& unknowns) {
    return scene.camera.raw_from_point(point_on_axis(unknowns.pose(), scene.marker.length_m() / 2));
  };
  const double radius_px =
      scene.marker.radius_m() / one.pose().camera_from_unrolled.translation.norm() * scene.camera.fx_px;
  return (middle(other) - middle(one)).norm() > radius_px;
}

// `beside` a marker neither that, nor a misprint, nor one that misses the RCM counts.
Found detect(const SearchFrame& frame, bool through_rcm, BlobWalk& walk, WorkBudget& budget,
             const PoseUnknowns* beside = nullptr) {
  const auto counts = [&](const Found& found) {
    if (!beside) return found.fit || found.status == Status::marker_mismatch;
    return found.fit && found.fit->unknowns.through_rcm() && are_apart(frame.scene, *beside, found.fit->unknowns);
  };
  Found best;
  for (; walk.blob < frame.blobs.size(); walk.next_blob()) {
    Found found = detect_in_blob(frame, through_rcm, walk, budget);
    walk.done = counts(found);
    if (walk.done || (!beside && best.status == Status::no_marker)) best = std::move(found);
    if (walk.done || walk.stopped) return best;
  }
  walk.done = true;
  return best;
}

// Whether the marker shows in another place as well: a second print, a reflection, an image of tiles. The RCM would
// show which is ours. All in one frame: in another a rival may be where none was. Nullopt where the budget ends first.
std::optional<bool> has_rival(const SearchFrame& frame, const FineFit& fit, WorkBudget& budget) {
  const Scene& scene = frame.scene;
  for (const Blob& blob : frame.blobs)
    for (const PoseUnknowns& start : starts_in(frame, false, blob, budget).poses) {
      if (!are_apart(scene, fit.unknowns, start)) continue;
      if (!budget.allows(costs.try_start())) return std::nullopt;
      const Found other = try_start(scene, frame.light, start, budget);
      const bool fits = other.fit && are_apart(scene, fit.unknowns, other.fit->unknowns);
      if (fits || other.status == Status::marker_mismatch) return true;
    }
  return false;
}

}  // namespace

Found follow(const Scene& scene, const LightImage& light, const PoseUnknowns& start, const Expected& expected,
             WorkBudget& budget) {
  Found near = fitted_from(scene, light, start, expected, budget);
  if (near.fit || near.status == Status::marker_mismatch) return near;
  if (const CoarseFit coarse = fitted_coarsely(scene, start, Rotation::known, budget); coarse.found)
    if (Found found = fitted_from(scene, light, coarse.unknowns, expected, budget); found.fit) return found;
  if (!scene.registration || !start.through_rcm()) return near;
  return fitted_from(scene, light, start.with_rcm(false), expected, budget);
}

// The candidate as it shows in this frame; whether it doesn't.
bool MarkerSearch::lost_candidate(const SearchFrame& frame, WorkBudget& budget) {
  const FineFit before = *candidate_;
  const Expected expected{true, before.blur, before.bias_px, before.departure};
  candidate_ = follow(frame.scene, frame.light, before.unknowns, expected, budget).fit;
  return !candidate_;
}

// While the look goes on, `plain` is what the last whole one came to.
void MarkerSearch::know(Found& plain) {
  if (plain.status != Status::no_marker || plain_.done) status_ = plain.status;
  plain.status = status_;
}

void MarkerSearch::begin_anew(Status status) {
  const bool other_bands = other_bands_;
  *this = MarkerSearch();
  status_ = status, other_bands_ = other_bands;
}

// A candidate whose rivals the budget leaves no time for waits for the next frame, in which they take what they take.
Found MarkerSearch::look_without_rcm(const SearchFrame& frame, WorkBudget& budget) {
  const bool waited = candidate_.has_value();
  if (waited && lost_candidate(frame, budget)) begin_anew(status_);
  if (!candidate_) {
    Found plain = detect(frame, false, plain_, budget);
    know(plain);
    if (plain_.done) other_bands_ = plain_.other_bands, plain_ = {};
    if (!plain.fit) return plain;
    candidate_ = plain.fit;
  }
  if (waited) budget.allow(WorkBudget::Beyond::all);
  const std::optional<bool> rival = has_rival(frame, *candidate_, budget);
  Found found{Status::ambiguous, std::nullopt, std::nullopt};
  if (rival == false) found = {Status::ok, std::move(candidate_), {}};
  // A result says nothing of a later frame in which it is lost.
  if (rival) begin_anew(*rival ? found.status : Status::no_marker);
  return found;
}

// A marker that shows plainly, but elsewhere than the RCM allows. That psi holds whatever the print is, validate() has
// tested: a misprint would contradict any registration.
Found MarkerSearch::despite_registration(const SearchFrame& frame, bool plain_is_known, WorkBudget& budget) {
  Found free = detect(frame, false, free_, budget);
  if (!free.fit || !free.fit->is_well_seen()) return {};
  if (plain_is_known) return free;
  // In this frame a fit through the RCM may be possible where none was before.
  BlobWalk again;
  budget.allow(WorkBudget::Beyond::all);
  Found through_rcm = detect(frame, true, again, budget);
  return through_rcm.fit ? through_rcm : free;
}

// The climb, and a fit to its result. False when the budget ends first.
bool MarkerSearch::finish_agreement(const SearchFrame& frame, WorkBudget& budget) {
  if (!agreement_->advance(frame.scene, budget)) return false;
  if (!budget.allows(costs.fit_to_result())) return false;
  Found found;
  if (const auto result = agreement_->result())
    found = fitted_from(frame.scene, frame.light, agreement_->in_this_frame(frame.scene, *result, budget), {}, budget);
  agreement_.reset();
  if (!found.fit) return true;
  has_rivals_ |= candidate_ && are_rivals(*candidate_, *found.fit);
  if (!candidate_ || found.fit->misfit() < candidate_->misfit()) candidate_ = found.fit;
  return true;
}

// The best of all that the starts on lines through the RCM lead to.
Found MarkerSearch::hidden(const SearchFrame& frame, WorkBudget& budget) {
  const std::vector<Blob> blobs = joined_blobs(frame.blobs);
  if (agreement_ && !finish_agreement(frame, budget)) return {};
  for (; hidden_.blob < blobs.size(); hidden_.next_blob()) {
    const auto starts = starts_in(frame, true, blobs[hidden_.blob], budget).poses;
    while (hidden_.start < starts.size()) {
      const PoseUnknowns& start = starts[hidden_.start++];
      agreement_ = AgreementSearch(start, frame.camera_from_rcm(), frame.scene.marker.length_m());
      if (!finish_agreement(frame, budget)) return {};
    }
  }
  hidden_.done = true;
  if (!candidate_) return {};
  if (has_rivals_) return refusal(Status::ambiguous, candidate_->unknowns);
  return {Status::ok, std::move(candidate_), {}};
}

Found MarkerSearch::look_long(const SearchFrame& frame, bool is_mismatch, bool plain_is_known, WorkBudget& budget) {
  if (!free_.done)
    if (Found found = despite_registration(frame, plain_is_known, budget); found.fit) return found;
  if (!free_.done) return {};
  other_bands_ = free_.other_bands;
  // Such a print is not hidden: this is what the search came to.
  if (is_mismatch) hidden_.done = true;
  return hidden_.done ? Found{} : hidden(frame, budget);
}

Found MarkerSearch::look_with_rcm(const SearchFrame& frame, WorkBudget& budget) {
  // The result of other blobs was worse than it, and is gone with it.
  if (candidate_ && lost_candidate(frame, budget)) hidden_ = {}, agreement_.reset(), has_rivals_ = false;
  const bool from_the_first = !plain_.begun();
  const WorkBudget::Beyond step = budget.allowed();
  Found plain = budget.share(searches_long_ ? budget.left() / 2 : budget.left(), step,
                             [&](WorkBudget& part) { return detect(frame, true, plain_, part); });
  if (plain.fit) {
    begin_anew(Status::no_marker);
    return plain;
  }
  const bool plain_is_known = plain_.done && from_the_first;
  const bool is_mismatch = plain.status == Status::marker_mismatch;
  know(plain);
  if (plain_.done) plain_ = {}, searches_long_ = true;
  if (!searches_long_) return plain;
  budget.allow(step);
  Found found = look_long(frame, is_mismatch, plain_is_known, budget);
  if (found.fit || hidden_.done) begin_anew(found.fit ? Status::no_marker : status_);
  if (found.fit || plain.status == Status::no_marker) return found;
  return plain;
}

Found MarkerSearch::look_beside(const PoseUnknowns& missing, const SearchFrame& frame, WorkBudget& budget) {
  Found found = detect(frame, true, plain_, budget, &missing);
  if (plain_.done) plain_ = {};
  return found;
}

Found MarkerSearch::look(const SearchFrame& frame, WorkBudget& budget) {
  Found found = frame.scene.knows_rcm() ? look_with_rcm(frame, budget) : look_without_rcm(frame, budget);
  const bool nothing_fits = found.status == Status::no_marker || found.status == Status::poor_fit;
  return nothing_fits && other_bands_ ? Found{Status::marker_mismatch, std::nullopt, std::nullopt} : found;
}

}  // namespace lapservo::internal
