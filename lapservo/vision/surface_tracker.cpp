#include "lapservo/vision/surface_tracker.h"

#include <algorithm>
#include <cstddef>

#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/decision/fit_observation.h"
#include "lapservo/vision/decision/two_moments.h"
#include "lapservo/vision/decision/verification.h"
#include "lapservo/vision/edges/blurred_edges.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

SurfaceTracker::SurfaceTracker(const Rig& rig, bool single, std::optional<double> frame_budget, double max_p_false)
    : rig_(rig),
      single_(single),
      frame_budget_(frame_budget),
      max_p_false_(max_p_false),
      classes_(rig.instruments),
      light_(rig.camera.response.table()),
      channels_(rig.camera),
      memory_(rig.instruments.size()),
      prints_(rig.instruments.size()),
      prints_before_(rig.instruments.size()),
      seen_before_(rig.instruments.size()),
      searches_(rig.instruments.size()),
      searched_beside_(rig.instruments.size()),
      found_(rig.instruments.size()),
      covers_(rig.instruments.size()),
      observations_(rig.instruments.size()) {
  others_.reserve(rig.instruments.size());
  for (const Instrument& instrument : rig.instruments) registrations_.push_back(registration_of(instrument));
  if (rig.instruments.size() > 1)
    for (ShaftCover& cover : covers_) cover.reserve(rig.camera);
  BlurredEdges::instance();  // takes milliseconds, which no frame should
}

void SurfaceTracker::forget(std::size_t i) {
  memory_[i].reset();
  seen_before_[i] = {};
  searches_[i] = MarkerSearch();
  searched_beside_[i] = 0;
}

void SurfaceTracker::disregard_frame(std::size_t i) {
  forget(i);
  prints_[i] = prints_before_[i];
}

void SurfaceTracker::forget() {
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) forget(i);
  std::fill(prints_.begin(), prints_.end(), PrintRecord());
  blended_s_.reset();
}

Scene SurfaceTracker::scene_of(const ImageView& image, std::size_t i) const {
  Scene scene{image, rig_.camera, classes_, rig_.instruments[i].marker, classes_.of_bands(i), others_};
  scene.known_sides = prints_[i].known_sides();
  scene.max_p_false = max_p_false_;
  scene.registration = registrations_[i] ? &*registrations_[i] : nullptr;
  return scene;
}

// Takes in the frame; says whether it, or one shortly before it, shows two moments of an instrument.
bool SurfaceTracker::remember(const ImageView& image) {
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    const std::optional<FineFit>& fit = found_[i].fit;
    const auto before = seen_before_[i];
    seen_before_[i] = {fit ? fit->unknowns.pose() : found_[i].refused, before[0]};
    if (!fit) continue;
    memory_[i] = remembered(memory_[i], *fit, found_[i].among_others, now_s_);
    if (shows_two_moments(scene_of(image, i), *fit, before)) blended_s_ = now_s_;
  }
  return blended_s_ && now_s_ - *blended_s_ < two_moments_limits.told_for_s;
}

void SurfaceTracker::learn_print(std::size_t i) {
  const Found& found = found_[i];
  using View = PrintRecord::View;
  const bool off = found.status == Status::marker_mismatch && found.refused;
  if (!off && !found.fit) return;
  const ShaftPose& pose = off ? *found.refused : found.fit->unknowns.pose();
  if (const auto tau_rad = facing_tau_rad(rig_.instruments[i].marker, pose))
    prints_[i].add(*tau_rad, off ? View::off : shows_the_rigs_print(*found.fit) ? View::the_rigs : View::possible);
}

void SurfaceTracker::cover(std::size_t i, const ShaftPose& pose, WorkBudget& budget) {
  if (!covers_[i].drawn()) {
    budget.spend(search_costs.cover);
    covers_[i].draw(rig_.camera, rig_.instruments[i].marker, classes_.of_bands(i), pose);
  }
  others_.push_back(&covers_[i]);
}

// Those that may hide or touch the one that is followed: where they were found in this frame, or are expected. Whether
// there are any.
bool SurfaceTracker::cover_expected(std::size_t i, WorkBudget& budget) {
  for (std::size_t j = 0; j < rig_.instruments.size(); ++j) {
    if (j == i || !memory_[j] || !rig_.instruments[j].camera_from_rcm) continue;
    const ShaftPose pose = found_[j].fit ? found_[j].fit->unknowns.pose() : memory_[j]->expected_pose(now_s_).pose();
    if (may_meet(rig_.camera, rig_.instruments[i].marker, memory_[i]->expected_pose(now_s_).pose(),
                 rig_.instruments[j].marker, pose))
      cover(j, pose, budget);
  }
  return !others_.empty();
}

// Those that were found, under or beside which the one that is looked for may be.
void SurfaceTracker::cover_found(std::size_t i, const std::vector<Blob>& blobs, WorkBudget& budget) {
  others_.clear();
  if (!rig_.instruments[i].camera_from_rcm) return;
  for (std::size_t j = 0; j < rig_.instruments.size(); ++j) {
    if (j == i || !found_[j].fit || !rig_.instruments[j].camera_from_rcm) continue;
    const ShaftPose& pose = found_[j].fit->unknowns.pose();
    if (std::any_of(blobs.begin(), blobs.end(), [&](const Blob& blob) {
          return lies_beside(rig_.camera, rig_.instruments[j].marker, pose, blob, classes_.of_bands(i));
        }))
      cover(j, pose, budget);
  }
}

// The parts that others hide matter only where it can't be followed without, or could not last time.
Found SurfaceTracker::follow_known(const ImageView& image, const LightImage& light, std::size_t i, WorkBudget& budget) {
  const InstrumentMemory& memory = *memory_[i];
  const auto follow_it = [&] {
    Found found =
        follow(scene_of(image, i), light, memory.expected_pose(now_s_), memory.blur, memory.expected(now_s_), budget);
    found.among_others = found.fit && !others_.empty();
    return found;
  };
  others_.clear();
  if (memory.among_others) cover_expected(i, budget);
  Found found = follow_it();
  if (!found.fit && !memory.among_others && cover_expected(i, budget)) found = follow_it(), followed_twice_ = true;
  if (found.fit) covers_[i].clear();  // where it was expected
  return found;
}

// Whether some were found.
bool SurfaceTracker::look_for_lost(const ImageView& image, const LightImage& light, const std::vector<Blob>& blobs,
                                   WorkBudget& budget, bool again) {
  std::size_t lost = 0;
  for (const Found& found : found_) lost += !found.fit;
  bool any = false;
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    if (found_[i].fit) continue;
    cover_found(i, blobs, budget);
    const bool new_others = others_.size() != searched_beside_[i];
    searched_beside_[i] = others_.size();
    if (new_others) searches_[i] = MarkerSearch();
    if (again && !new_others) continue;
    // Who was followed in vain, or took twice the work for it, has all of the next frame.
    const auto beyond = followed_twice_ || followed_in_vain_ ? WorkBudget::Beyond::none : WorkBudget::Beyond::first;
    const double units = budget.left() / static_cast<double>(lost--) * (others_.empty() ? 1 : search_costs.part_beside);
    const std::vector<Blob> parts = others_.empty() ? std::vector<Blob>() : without(blobs, others_);
    found_[i] = budget.share(units, beyond, [&](WorkBudget& part) {
      return searches_[i].look({scene_of(image, i), light, others_.empty() ? blobs : parts}, part);
    });
    found_[i].among_others = found_[i].fit && !others_.empty();
    any |= found_[i].fit.has_value();
  }
  return any;
}

// Those that are followed first: the others share what is left of the budget. Without a budget they are looked for
// again beside those that were found after them: else the next frame does that.
void SurfaceTracker::find(const ImageView& image, const LightImage& light, WorkBudget& budget) {
  for (ShaftCover& cover : covers_) cover.clear();
  bool lost = followed_twice_ = followed_in_vain_ = false;
  std::fill(found_.begin(), found_.end(), Found{});  // in all, before one is followed beside the others
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    if (memory_[i]) found_[i] = follow_known(image, light, i, budget);
    lost |= !found_[i].fit;
    followed_in_vain_ |= memory_[i] && !found_[i].fit;
  }
  if (!lost) return;
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i)
    if (!found_[i].fit) memory_[i].reset(), covers_[i].clear();
  budget.spend(search_costs.blobs_per_px * image.width_px * image.height_px);
  const std::vector<Blob> blobs = largest_blobs(image, classes_);
  bool more = look_for_lost(image, light, blobs, budget, false);
  while (more && (single_ || !frame_budget_)) more = look_for_lost(image, light, blobs, budget, true);
}

const std::vector<Observation>& SurfaceTracker::track(const cv::Mat& image_bgr, std::optional<double> time_s) {
  const ImageView image(image_bgr);
  const LightImage light(image, light_, channels_);
  if (single_) forget();
  now_s_ = clock_.next(time_s);
  for (PrintRecord& print : prints_) print.begin_frame(now_s_);
  prints_before_ = prints_;
  WorkBudget budget(single_ ? std::nullopt : frame_budget_);
  find(image, light, budget);
  const bool is_blended = remember(image);
  for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
    const Found& found = found_[i];
    if (!is_blended) learn_print(i);
    observations_[i] = {};
    observations_[i].status = found.status;
    if (found.refused) observations_[i] = refused_observation(found.status, *found.refused);
    if (!found.fit) continue;
    const FineFit& fit = *found.fit;
    if (!rig_.instruments[i].marker.bands_are_measured() && prints_[i].is_off())
      observations_[i] = refused_observation(Status::marker_mismatch, fit.unknowns.pose());
    else if (is_blended)
      observations_[i] = refused_observation(Status::blended, fit.unknowns.pose());
    else
      observations_[i] = observation_of(scene_of(image, i), fit);
  }
  return observations_;
}

}  // namespace lapservo::internal
