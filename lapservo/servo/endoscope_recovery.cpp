#include "lapservo/servo/endoscope_recovery.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "lapservo/servo/image_features.h"

namespace lapservo::internal {
using namespace endoscope;
namespace {

constexpr int agreed_after = 10, moved_after = 2;

// Largest believable motion of theta, phi (rad), rho (m) against the joints, from one image to the next. A turn about
// the RCM looks like a jump of the joints, which these would have shown.
const Eigen::Vector3d max_jump(0.03, 0.03, 0.003);

// By so much a shaft misfits the RCM of an endoscope that moved, while the offset moves, and where it is not seen to.
constexpr double moving_misfit_rad = 1.7e-3, plain_misfit_rad = 5e-3;

// Offsets from so long ago are those of before the endoscope began to move.
constexpr double offset_age_s = 0.7, offset_memory_s = 1.5;

// Joints that have been silent for so long may have gone anywhere since.
constexpr double silent_s = 0.1;

constexpr std::size_t min_images = 30, max_images = 200, max_compared = 40, explained_again_after = 2;

// Sightings differ by one of these at least (rad, m), however fast the camera and slow the operator is.
const Eigen::Vector4d min_motion(3e-3, 3e-3, 2e-4, 8e-3);

// A registration within these is good enough; images that are farther off contradict each other.
constexpr double max_rms_px = 1, max_newest_rms_px = 3, max_sigma_m = 1e-3, max_sigma_rad = 0.02;

bool moved(const MarkerSighting& from, const MarkerSighting& to) {
  return ((to.q - from.q).array().abs() >= min_motion.array()).any();
}

// The last one is always the newest, so that what an endoscope does while the instrument rests leaves one sighting
// only. Where there are many, half of them are enough to go on with. Whether the instrument has moved.
bool add(std::vector<MarkerSighting>& sightings, const MarkerSighting& seen, std::size_t most) {
  const std::size_t count = sightings.size();
  if (count >= 2 && !moved(sightings[count - 2], seen)) sightings.pop_back();
  if (sightings.size() == most) {
    std::size_t kept = 0;
    for (std::size_t k = 0; k < most; k += 2) sightings[kept++] = sightings[k];
    sightings.resize(kept);
  }
  sightings.push_back(seen);
  return sightings.size() != count;
}

bool contradicts_itself(const RegistrationFit& fit) {
  return !(fit.rms_px < max_rms_px && fit.newest_rms_px < max_newest_rms_px);
}

bool is_certain(const RegistrationFit& fit) {
  const auto variances = fit.covariance.diagonal();
  return std::sqrt(variances.head<3>().sum()) < max_sigma_m && std::sqrt(variances.tail<3>().sum()) < max_sigma_rad;
}

}  // namespace

EndoscopeRecovery::EndoscopeRecovery(const Rig& rig)
    : rig_(rig), camera_from_rcm_(rig.instruments.at(0).camera_from_rcm) {}

void EndoscopeRecovery::see(const ServoInput& input, VisualController& controller) {
  if (const auto* measuring = std::get_if<Measuring>(&state_); measuring && measuring->certain && input.joints.started)
    start(measuring->sightings, controller);
  if (input.joints.time_s - joints_s_ > silent_s) joints_from_s_ = input.joints.time_s;
  joints_s_ = input.joints.time_s;
  const auto& image = input.image;
  if (!image) return;
  const bool silent = image->time_s < joints_from_s_ || image->time_s > joints_s_ + silent_s;
  if (silent || (!image->found && !image->camera_from_marker)) return drop_suspicion(controller);
  // An image that repeats is no moved endoscope: that would show another one.
  if (!follow_joints(*image, controller) || image->repetition != Repetition::none) return;
  collect(*image, controller);
  if (!image->found) return;
  if (auto* watching = std::get_if<Watching>(&state_)) watch(*watching, *image, controller);
}

void EndoscopeRecovery::collect(const ImageMeasurement& image, VisualController& controller) {
  if (!image.camera_from_marker || !sees_from_start_) return;
  if (add(seen_, sighting(image), max_compared)) ++sightings_;
  // The operator's motion may show which number it is.
  if (const auto why = wrong_rig(); why && why->cause == Explanation::Cause::rig && sightings_ >= explain_at_)
    blames_rig(controller, Blame::named);
}

// Whether the rig was wrong from the start.
bool EndoscopeRecovery::blames_rig(VisualController& controller, Blame wanted) {
  const Explanation why = explain_disagreement(seen_, instrument());
  const std::size_t again = std::min(max_compared, explained_again_after * seen_.size());
  explain_at_ = sightings_ + std::max<std::size_t>(1, again - std::min(again, seen_.size()));
  if (!why.is_of_the_rig() || (wanted != Blame::any && why.cause == Explanation::Cause::rig)) return false;
  if (wanted == Blame::sign && why.cause != Explanation::Cause::sign) return false;
  state_ = WrongRig{why};
  controller.suspend(HoldReason::wrong_rig);
  return true;
}

std::optional<Explanation> EndoscopeRecovery::wrong_rig() const {
  const auto* wrong = std::get_if<WrongRig>(&state_);
  return wrong ? std::optional(wrong->why) : std::nullopt;
}

// Without a marker there would be nothing to measure with.
void EndoscopeRecovery::watch(Watching& watching, const ImageMeasurement& image, VisualController& controller) {
  const Eigen::Vector4d before = watching.offsets.empty() ? trusted_ : watching.offsets.back().seen.offset;
  seen_joints_ =
      image.camera_from_marker ? seen_joints(rig_.camera, instrument(), sighting(image), before) : std::nullopt;
  const bool moves = stepped(image, controller.delay_is_known());
  const bool contradicts =
      seen_joints_ && (misfits(watching, moves) || jumps(before, controller.config().observer.max_offset));
  watching.contradicting = contradicts ? watching.contradicting + 1 : 0;
  if (!contradicts && !moves) return drop_suspicion(controller);
  if (agreeing_ < agreed_after) return;
  if (watching.contradicting >= moved_after)
    return blames_rig(controller, Blame::any) ? void() : notice(watching.offsets, controller);
  watching.suspects = true;
  controller.suspend(HoldReason::endoscope_moved);
}

// A registration that is a little wrong misfits from the start, by more and less as the arm moves.
bool EndoscopeRecovery::misfits(const Watching& watching, bool moves) const {
  const SeenJoints agreed = watching.offsets.empty() ? SeenJoints{} : watching.offsets.front().seen;
  const double least_rad = std::max(moves ? moving_misfit_rad : plain_misfit_rad, 2 * agreed.misfit_rad);
  return seen_joints_->misfit_rad > std::max(least_rad, largest_misfit_rad(instrument(), agreed, *seen_joints_));
}

// Since the image before, or farther from the joints than the loop's own offset can go.
bool EndoscopeRecovery::jumps(const Eigen::Vector4d& before, const Eigen::Vector4d& max_offset) const {
  const Eigen::Vector4d beyond = seen_joints_->offset.cwiseAbs() - max_offset;
  return ((seen_joints_->offset - before).cwiseAbs().cwiseMax(beyond).head<3>().array() > max_jump.array()).any();
}

void EndoscopeRecovery::drop_suspicion(VisualController& controller) {
  auto* watching = std::get_if<Watching>(&state_);
  if (!watching) return;
  if (watching->suspects) controller.resume();
  watching->suspects = false;
  watching->contradicting = 0;
}

bool EndoscopeRecovery::stepped(const ImageMeasurement& image, bool delay_is_known) {
  if (image.registration != registration_of_steps_) steps_.drop_latest();
  registration_of_steps_ = image.registration;
  if (!seen_joints_) {
    steps_.interrupt();
    return false;
  }
  SeenOffset now{measured_->stamp_s};
  now.measured.head<3>() = measured_->q.head<3>(), now.rate_per_s.head<3>() = measured_->rate.head<3>();
  now.offset << seen_joints_->offset.head<3>(), seen_joints_->misfit_rad;
  now.covariance.topLeftCorner<3, 3>() = seen_joints_->covariance.topLeftCorner<3, 3>();
  return steps_.add(now, delay_is_known);
}

void EndoscopeRecovery::doubt(HoldReason reason, VisualController& controller) {
  const bool watches = std::holds_alternative<Watching>(state_);
  // Another registration or offset does not make an image stand still.
  const bool still = reason == HoldReason::image_not_following;
  if ((still || reason == HoldReason::psi_contradicted) && watches && sightings_ >= explain_at_)
    blames_rig(controller, still ? Blame::sign : Blame::named);
  if (reason != HoldReason::wild_joints && reason != HoldReason::frozen_image) return;
  seen_.clear();
  sees_from_start_ = false;
  agreeing_ = 0;
  drop_suspicion(controller);
  auto* watching = std::get_if<Watching>(&state_);
  if (!watching) return wrong_rig() ? void() : measure(controller);
  if (reason == HoldReason::wild_joints) watching->offsets.clear();
}

bool EndoscopeRecovery::follow_joints(const ImageMeasurement& image, VisualController& controller) {
  const Eigen::Array2d plain(5e-5, 1e-3);  // motion from image to image
  const auto q = controller.measured_at(image);
  if (!q || !std::isfinite(image.time_s)) return false;
  Measured now{image.time_s, *q, Eigen::Vector4d::Zero(), Eigen::Vector2i::Zero()};
  if (measured_ && now.stamp_s > measured_->stamp_s) {
    const Eigen::Vector4d moved = now.q - measured_->q;
    now.rate = moved / (now.stamp_s - measured_->stamp_s);
    for (Eigen::Index k = 0; k < 2; ++k)
      now.sides[k] = std::abs(moved[2 + k]) > plain[k] ? (moved[2 + k] > 0 ? 1 : -1) : measured_->sides[k];
  }
  measured_ = now;
  // Until another offset is trusted, it is this path's.
  const auto* watching = std::get_if<Watching>(&state_);
  const bool goes_on = !watching || (watching->offsets.empty() && agreeing_ >= agreed_after);
  if (goes_on && !path_.joints.empty() && path_.joints.back() != now.q.tail<2>())
    path_.joints.emplace_back(now.q.tail<2>());
  return true;
}

void EndoscopeRecovery::follow(const ServoInput& input, const ControlStep& step, VisualController& controller) {
  if (auto* watching = std::get_if<Watching>(&state_)) return trust(*watching, input, step);
  if (!input.image || input.image->repetition != Repetition::none) return;
  const auto seen = sighting_of(*input.image);
  if (auto* measuring = std::get_if<Measuring>(&state_); measuring && seen) collect(*measuring, *seen, controller);
}

void EndoscopeRecovery::trust(Watching& watching, const ServoInput& input, const ControlStep& step) {
  const auto& image = input.image;
  if (!image || !image->found || !image->q || step.action != ControlAction::track || !step.estimate || !measured_)
    return;
  agreeing_ = std::min(agreeing_ + 1, agreed_after);
  const Eigen::Vector4d offset = step.estimate->q - input.joints.q.vector();
  watching.offsets.push_back({input.time_s, offset, *measured_, seen_joints_.value_or(SeenJoints{offset})});
  while (input.time_s - watching.offsets.front().time_s > offset_memory_s) watching.offsets.pop_front();
}

void EndoscopeRecovery::notice(const std::deque<Offset>& offsets, VisualController& controller) {
  // Where none was trusted since the last time, that time's still holds.
  if (!offsets.empty()) trust_before(offsets);
  camera_from_rcm_.reset();
  ++registration_;
  measure(controller);
}

void EndoscopeRecovery::trust_before(const std::deque<Offset>& offsets) {
  // Where the latest are too young, the oldest that there is.
  auto offset = std::prev(offsets.end());
  while (offset != offsets.begin() && offsets.back().time_s - offset->time_s < offset_age_s) --offset;
  trusted_ = offset->q;
  path_ = {offset->measured.sides, {}};
  for (; offset != offsets.end(); ++offset) path_.joints.emplace_back(offset->measured.q.tail<2>());
  path_.joints.emplace_back(measured_->q.tail<2>());
}

void EndoscopeRecovery::measure(VisualController& controller) {
  state_ = Measuring{{}, min_images};
  controller.suspend(HoldReason::endoscope_moved);
}

MarkerSighting EndoscopeRecovery::sighting(const ImageMeasurement& image) const {
  return {image.time_s, measured_->q, measured_->rate, *image.camera_from_marker};
}

std::optional<MarkerSighting> EndoscopeRecovery::sighting_of(const ImageMeasurement& image) const {
  if (!image.camera_from_marker || !measured_ || measured_->stamp_s != image.time_s) return std::nullopt;
  MarkerSighting seen = sighting(image);
  seen.q += trusted_;
  seen.path_index = path_.joints.size() - 1;
  return seen;
}

void EndoscopeRecovery::collect(Measuring& measuring, const MarkerSighting& seen, VisualController& controller) {
  Sightings& sightings = measuring.sightings;
  if (!add(sightings, seen, max_images) || measuring.certain || sightings.size() < measuring.fit_at) return;
  const auto found = fit(sightings);
  const bool contradicts = found && contradicts_itself(*found);
  if (found && !contradicts && is_certain(*found)) {
    measuring.certain = true;
    return controller.suspend(HoldReason::endoscope_measured);
  }
  if ((!found || contradicts) && blames_rig(controller, Blame::any)) return;
  // The endoscope moved once more: the newer ones may all be of where it is now.
  if (contradicts) sightings.erase(sightings.begin(), sightings.begin() + static_cast<long>(sightings.size() / 2));
  measuring.fit_at = std::clamp(sightings.size() * 3 / 2, min_images, max_images);
}

std::optional<RegistrationFit> EndoscopeRecovery::fit(const Sightings& sightings) const {
  return fit_registration(rig_.camera, rig_.instruments.front().marker, sightings, path_);
}

void EndoscopeRecovery::start(const Sightings& sightings, VisualController& controller) {
  const auto found = fit(sightings);
  if (!found || contradicts_itself(*found)) return measure(controller);
  state_ = Watching{};
  agreeing_ = agreed_after;
  camera_from_rcm_ = rig_.instruments[0].camera_from_rcm = found->camera_from_rcm;
  rig_.instruments[0].registration_covariance = found->covariance;
  seen_.clear();
  sees_from_start_ = true;
  ++registration_;
  controller.resume(feature_model(rig_, found->camera_from_rcm));
}

}  // namespace lapservo::internal
