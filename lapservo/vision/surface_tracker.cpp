#include "lapservo/vision/surface_tracker.h"

#include <algorithm>
#include <utility>

#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/decision/fit_observation.h"
#include "lapservo/vision/decision/two_moments.h"
#include "lapservo/vision/decision/verification.h"
#include "lapservo/vision/edges/blurred_edges.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

SurfaceTracker::SurfaceTracker(const Rig& rig, const TrackerOptions& options)
    : rig_(rig),
      options_(options),
      classes_(rig.instruments),
      light_(rig.camera.response.table()),
      channels_(rig.camera),
      observations_(rig.instruments.size()) {
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    const Instrument& instrument = rig_.instruments[i];
    tracked_.push_back({instrument, classes_.of_bands(i), registration_of(instrument)});
  }
  others_.reserve(tracked_.size());
  for (Tracked& it : tracked_) it.beside.reserve(tracked_.size());
  BlurredEdges::instance();  // takes milliseconds, which no frame should
}

void SurfaceTracker::forget(std::size_t i) {
  Tracked& it = tracked_[i];
  it.memory.reset(), it.beside.clear();
  it.seen_before = {};
  it.search = MarkerSearch();
}

void SurfaceTracker::disregard_frame(std::size_t i) {
  forget(i);
  tracked_[i].print = tracked_[i].print_before;
}

void SurfaceTracker::forget() {
  for (std::size_t i = 0; i < tracked_.size(); ++i) forget(i), tracked_[i].print = {};
  blended_s_.reset();
}

Scene SurfaceTracker::scene_of(const ImageView& image, const Tracked& it) const {
  Scene scene{image, rig_.camera, classes_, it.instrument.marker, it.bands, others_};
  scene.known_sides = it.print.known_sides();
  scene.max_p_false = options_.max_p_false;
  scene.registration = it.registration ? &*it.registration : nullptr;
  if (rig_.camera.readout_s != 0) scene.before = pose_before(it);
  return scene;
}

// Also what was refused: a marker that moves looks like another one before its motion is known.
std::optional<PoseBefore> SurfaceTracker::pose_before(const Tracked& it) const {
  if (const auto& known = it.memory)
    return PoseBefore{known->fit.unknowns, known->time_s - now_s_, known->step, known->step_s};
  const std::optional<ShaftPose>& seen = it.seen_before[0];
  if (!seen) return std::nullopt;
  return PoseBefore{{*seen, false}, before_s_ - now_s_ + exposed_after_s(rig_.camera, it.instrument.marker, *seen)};
}

// When the middle of its marker is exposed in this frame.
double SurfaceTracker::seen_s(const Tracked& it, const PoseUnknowns& pose) const {
  return now_s_ + exposed_after_s(rig_.camera, it.instrument.marker, pose.pose());
}

PoseUnknowns SurfaceTracker::expected_pose(const Tracked& it) const {
  return it.memory->expected_pose(seen_s(it, it.memory->fit.unknowns));
}

// Takes in the frame; says whether it, or one shortly before it, shows two moments of an instrument.
bool SurfaceTracker::remember(const ImageView& image) {
  for (Tracked& it : tracked_) {
    const std::optional<FineFit>& fit = it.found.fit;
    const auto before = it.seen_before;
    it.seen_before = {fit ? fit->unknowns.pose() : it.found.refused, before[0]};
    if (!fit) continue;
    it.memory = remembered(it.memory, *fit, seen_s(it, fit->unknowns));
    if (shows_two_moments(scene_of(image, it), *fit, before)) blended_s_ = now_s_;
  }
  return blended_s_ && now_s_ - *blended_s_ < two_moments_limits.told_for_s;
}

void SurfaceTracker::learn_print(Tracked& it) {
  using View = PrintRecord::View;
  const bool off = it.found.status == Status::marker_mismatch && it.found.refused;
  if (!off && !it.found.fit) return;
  const ShaftPose& pose = off ? *it.found.refused : it.found.fit->unknowns.pose();
  if (const auto tau_rad = facing_tau_rad(it.instrument.marker, pose))
    it.print.add(*tau_rad, off ? View::off : shows_the_rigs_print(*it.found.fit) ? View::the_rigs : View::possible);
}

// Where it was found, or is expected.
ShaftPose SurfaceTracker::likely_pose(const Tracked& it) const {
  return it.found.fit ? it.found.fit->unknowns.pose() : expected_pose(it).pose();
}

// Where another instrument lies; nullptr where that is not known, as where its registration is not.
const ShaftCover* SurfaceTracker::cover_of(Tracked& other, bool is_found) const {
  if (!other.registration || !(other.found.fit || (other.memory && !is_found))) return nullptr;
  return &other.cover.emplace(rig_.camera, other.instrument.marker, other.bands, likely_pose(other));
}

// Those that may hide or touch it, found or expected; or only those that were found before it. Whether there are any.
bool SurfaceTracker::cover_expected(const Tracked& known, bool only_before) {
  const Marker& marker = known.instrument.marker;
  const ShaftPose pose = likely_pose(known);
  others_.clear();
  for (Tracked& other : tracked_) {
    const ShaftCover* const cover = &other == &known ? nullptr : cover_of(other, only_before);
    if (cover && cover->may_meet(marker, pose) && (!only_before || cover->lies_before(marker, pose)))
      others_.push_back(cover);
  }
  return !others_.empty();
}

// Fits again who was fitted without one that lies before it: where the sides of both meet looks like a boundary.
void SurfaceTracker::fit_behind(const ImageView& image, const LightImage& light, WorkBudget& budget) {
  for (Tracked& it : tracked_) {
    if (!it.found.fit || !cover_expected(it, true) || std::ranges::includes(it.beside, others_)) continue;
    cover_expected(it);
    const Expected expected = it.memory ? it.memory->expected(now_s_) : Expected{};
    it.found = follow(scene_of(image, it), light, it.found.fit->unknowns, expected, budget);
    it.beside = others_;
    if (!it.found.fit) it.beside.clear();  // it is looked for again
    next_frame_ = true;
  }
}

// Those that were found, under or beside which the one that is looked for may be.
void SurfaceTracker::cover_found(const Tracked& lost, const std::vector<Blob>& blobs) {
  others_.clear();
  if (!lost.registration) return;
  for (Tracked& other : tracked_) {
    const ShaftCover* const cover = &other == &lost ? nullptr : cover_of(other, true);
    if (cover && std::ranges::any_of(blobs, [&](const Blob& blob) { return cover->lies_beside(blob, lost.bands); }))
      others_.push_back(cover);
  }
}

Found SurfaceTracker::follow_known(const ImageView& image, const LightImage& light, Tracked& known,
                                   WorkBudget& budget) {
  cover_expected(known);
  known.beside = others_;
  return follow(scene_of(image, known), light, expected_pose(known), known.memory->expected(now_s_), budget);
}

// Whether it is not found, or misses the well known RCM: another one may pass through that.
bool SurfaceTracker::is_lost(const Tracked& it) {
  const std::optional<RcmPrior>& rcm = it.registration;
  return !it.found.fit ||
         (rcm && rcm->is_within(it.instrument.marker.radius_m()) && !it.found.fit->unknowns.through_rcm());
}

// Whether some were found.
bool SurfaceTracker::look_for_lost(const ImageView& image, const LightImage& light, const std::vector<Blob>& blobs,
                                   WorkBudget& budget, bool again) {
  auto lost = std::ranges::count_if(tracked_, is_lost);
  bool any = false;
  for (Tracked& it : tracked_) {
    if (!is_lost(it)) continue;
    cover_found(it, blobs);
    const bool misses_rcm = it.found.fit.has_value();
    if (!misses_rcm && again && others_ == it.beside) continue;
    if (!misses_rcm && others_ != it.beside) it.search = MarkerSearch(), it.beside = others_;
    // Who was followed in vain, or took twice the work for it, has all of the next frame.
    const auto beyond = next_frame_ ? WorkBudget::Beyond::none : WorkBudget::Beyond::first;
    const double units = budget.left() / static_cast<double>(lost--) * (others_.empty() ? 1 : search_costs.part_beside);
    const std::vector<Blob> parts = others_.empty() ? std::vector<Blob>() : without(blobs, others_);
    Found found = budget.share(units, beyond, [&](WorkBudget& part) {
      const SearchFrame frame{scene_of(image, it), light, others_.empty() ? blobs : parts};
      return misses_rcm ? it.search.look_beside(it.found.fit->unknowns, frame, part) : it.search.look(frame, part);
    });
    any |= found.fit.has_value();
    if (misses_rcm && !found.fit) continue;
    if (misses_rcm) it.memory.reset(), it.seen_before = {}, it.beside = others_;
    it.found = std::move(found);
  }
  return any;
}

// Those that are followed first: the others share what is left of the budget. Without a budget they are looked for
// again beside those that were found after them: else the next frame does that.
void SurfaceTracker::find(const ImageView& image, const LightImage& light, WorkBudget& budget) {
  for (Tracked& it : tracked_) it.found = {};  // all, before one is followed beside the others
  next_frame_ = false;
  for (Tracked& it : tracked_)
    if (it.memory) it.found = follow_known(image, light, it, budget);
  fit_behind(image, light, budget);
  for (Tracked& it : tracked_) {
    if (it.found.fit) continue;
    next_frame_ |= it.memory.has_value();
    it.memory.reset();
  }
  if (std::ranges::none_of(tracked_, is_lost)) return;
  budget.spend(search_costs.blobs_per_px * image.width_px * image.height_px);
  const std::vector<Blob> blobs = largest_blobs(image, classes_);
  bool more = true;
  for (std::size_t looks = 0; more && looks <= tracked_.size(); ++looks) {
    more = look_for_lost(image, light, blobs, budget, looks > 0) && (options_.single || !options_.frame_budget);
    fit_behind(image, light, budget);
  }
}

Observation SurfaceTracker::observed(const ImageView& image, const Tracked& it, bool is_blended) const {
  const Found& found = it.found;
  if (!found.fit) return refused_observation(found.status, found.refused);
  const ShaftPose& pose = found.fit->unknowns.pose();
  if (!it.instrument.marker.bands_are_measured() && it.print.is_off())
    return refused_observation(Status::marker_mismatch, pose);
  if (is_blended) return refused_observation(Status::blended, pose);
  if (rig_.camera.readout_s == 0 || options_.single) return observation_of(scene_of(image, it), *found.fit);
  // How it moves while rows are read is not known before.
  if (!found.fit->motion.to_frame_sigma()) return refused_observation(Status::uncertain, pose);
  return observation_of(scene_of(image, it), found.fit->at_frame());
}

const std::vector<Observation>& SurfaceTracker::track(const cv::Mat& image_bgr, std::optional<double> time_s) {
  const ImageView image(image_bgr);
  const LightImage light(image, light_, channels_);
  if (options_.single) forget();
  before_s_ = std::exchange(now_s_, clock_.next(time_s));
  for (Tracked& it : tracked_) it.print.begin_frame(now_s_), it.print_before = it.print;
  WorkBudget budget(options_.single ? std::nullopt : options_.frame_budget);
  find(image, light, budget);
  const bool is_blended = remember(image);
  for (std::size_t i = 0; i < tracked_.size(); ++i) {
    const bool may_roll = rig_.camera.readout_s != 0 && !tracked_[i].seen_before[1];
    if (!is_blended && !may_roll) learn_print(tracked_[i]);
    observations_[i] = observed(image, tracked_[i], is_blended);
  }
  return observations_;
}

}  // namespace lapservo::internal
