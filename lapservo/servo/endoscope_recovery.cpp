#include "lapservo/servo/endoscope_recovery.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/servo/image_features.h"

namespace lapservo::internal {
namespace {

constexpr int agreed_after = 10, moved_after = 2;

// Of theta, phi (rad), rho (m) against the joints, from one image to the next: more than these tell.
const Eigen::Vector3d max_jump(0.03, 0.03, 0.003);

// Offsets from so long ago are those of before the endoscope began to move.
constexpr double offset_age_s = 0.7, offset_memory_s = 1.5;

// The endoscope rests when no edge moves farther in so long; a hundredth of a millimetre or two.
constexpr double rest_s = 0.3, rest_px = 1.5;
constexpr std::size_t min_rest_images = 5, min_images = 30, max_images = 400;

// However fast the camera is: sightings are so far apart at least, those that make it finer farther.
constexpr double apart_s = 0.012, refining_apart_s = 0.06;
constexpr std::size_t refining_each = 4;

// An attempt has failed when its images have not shown the marker for so long.
constexpr double max_lost_s = 2;

// What a registration has to be to be gone by.
constexpr double max_rms_px = 1, max_sigma_m = 2e-3, max_sigma_rad = 0.02;

const ProbingConfig small_motion{.distance = {0.06, 0.06, 0.004, 0.16}, .joint_time_s = 0.9};

// Back rather than in, where there is room for it.
ProbingMotion exploring_motion(JointLimits limits, const Eigen::Vector4d& q_joint) {
  if (q_joint[2] - small_motion.distance[2] > limits.lower[2]) limits.upper[2] = q_joint[2];
  return {small_motion, limits, q_joint};
}

Eigen::Matrix<double, 8, 1> edges_of(const ImageMeasurement& image) {
  Eigen::Matrix<double, 8, 1> edges;
  edges << image.ends_px.head<2>(), image.marker->inner_px, image.ends_px.tail<2>();
  return edges;
}

}  // namespace

EndoscopeRecovery::EndoscopeRecovery(const Rig& rig, const ControllerConfig& config)
    : rig_(rig),
      limits_(config.limits),
      max_attempts_(config.endoscope_attempts),
      camera_from_rcm_(rig.instruments.at(0).camera_from_rcm) {}

void EndoscopeRecovery::see(const ServoInput& input, VisualController& controller) {
  follows_ = input.joints.follows;
  const auto& image = input.image;
  if (!image) return;
  if (!image->found && !image->marker) return drop_suspicion(controller);
  if (!follow_joints(*image, controller) || phase_ != Phase::watching || !image->found) return;
  // An endoscope that moved would show another picture.
  if (image->repetition != Repetition::none) return;
  // Without a marker there would be nothing to measure with.
  const bool moves = stepped(*image, controller.delay_is_known());
  const bool contradicts = image->marker && (!image->q || jumped(*image->q));
  contradicting_ = contradicts ? contradicting_ + 1 : 0;
  if (!contradicts && !(moves && image->marker)) return drop_suspicion(controller);
  if (agreeing_ < agreed_after) return;
  if (contradicting_ >= moved_after) return notice(controller);
  suspected_ = true;
  controller.recover({});
}

void EndoscopeRecovery::drop_suspicion(VisualController& controller) {
  if (suspected_ && phase_ == Phase::watching) controller.believe();
  suspected_ = false;
  contradicting_ = 0;
}

bool EndoscopeRecovery::stepped(const ImageMeasurement& image, bool delay_is_known) {
  if (!image.q) steps_.interrupt();
  if (image.registration != registration_of_steps_) steps_.drop_latest();
  registration_of_steps_ = image.registration;
  if (!image.q) return false;
  return steps_.add(
      {measured_->stamp_s, measured_->q.head<3>(), measured_->rate.head<3>(), (*image.q - measured_->q).head<3>()},
      delay_is_known);
}

void EndoscopeRecovery::doubt(HoldReason reason, VisualController& controller) {
  if (reason != HoldReason::wild_joints && reason != HoldReason::frozen_image) return;
  agreeing_ = 0;
  drop_suspicion(controller);
  if (reason == HoldReason::frozen_image) {
    if (phase_ == Phase::resting || phase_ == Phase::exploring) rest_again(controller);
    return;
  }
  offsets_.clear();
  refine_at_s_.clear();  // its sightings go by the joints of before
}

// A turn about the RCM looks like a jump of the joints, which these would have told.
bool EndoscopeRecovery::jumped(const Eigen::Vector4d& q_seen) const {
  if (offsets_.empty()) return false;
  const Eigen::Vector4d off = q_seen - measured_->q - offsets_.back().q;
  return (off.head<3>().cwiseAbs().array() > max_jump.array()).any();
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
  if (collects() && path_.joints.back() != now.q.tail<2>()) path_.joints.emplace_back(now.q.tail<2>());
  return true;
}

// Until another offset is trusted, it is this path's.
bool EndoscopeRecovery::collects() const {
  if (path_.joints.empty() || phase_ == Phase::failed) return false;
  return phase_ != Phase::watching || !refine_at_s_.empty() || (offsets_.empty() && agreeing_ >= agreed_after);
}

void EndoscopeRecovery::follow(const ServoInput& input, const ControlStep& step, VisualController& controller) {
  switch (phase_) {
    case Phase::watching:
      trust(input, step);
      return refine(input, controller);
    case Phase::resting:
      return wait_for_rest(input);
    case Phase::exploring:
      return explore(input, step, controller);
    case Phase::failed:
      return;
  }
}

void EndoscopeRecovery::trust(const ServoInput& input, const ControlStep& step) {
  const auto& image = input.image;
  if (!image || !image->found || !image->q || step.action != ControlAction::track || !step.estimate || !measured_)
    return;
  agreeing_ = std::min(agreeing_ + 1, agreed_after);
  offsets_.push_back({input.time_s, step.estimate->q - input.joints.q.vector(), *measured_});
  while (input.time_s - offsets_.front().time_s > offset_memory_s) offsets_.pop_front();
}

void EndoscopeRecovery::notice(VisualController& controller) {
  suspected_ = false;
  // Where none was trusted since the last time, that time's still holds.
  if (!offsets_.empty()) trust_before();
  camera_from_rcm_.reset();
  refine_at_s_.clear();
  oldest_counted_ = ++registration_;
  rest_again(controller);
}

void EndoscopeRecovery::trust_before() {
  // Where the latest are too young, the oldest that there is.
  const double last_s = offsets_.back().time_s;
  std::deque<Offset> later;
  while (offsets_.size() > 1 && last_s - offsets_.back().time_s < offset_age_s) {
    later.push_front(offsets_.back());
    offsets_.pop_back();
  }
  later.push_front(offsets_.back());
  trusted_ = offsets_.back().q;
  offsets_.clear();
  path_ = {later.front().measured.sides, {}};
  for (const Offset& offset : later) path_.joints.emplace_back(offset.measured.q.tail<2>());
  path_.joints.emplace_back(measured_->q.tail<2>());
}

void EndoscopeRecovery::rest_again(VisualController& controller) {
  phase_ = follows_ && failed_ < max_attempts_ ? Phase::resting : Phase::failed;
  sightings_.clear();
  controller.recover({});
}

std::optional<MarkerSighting> EndoscopeRecovery::sighting_of(const ImageMeasurement& image) const {
  if (!image.marker || !measured_ || measured_->stamp_s != image.time_s) return std::nullopt;
  MarkerSighting sighting;
  sighting.edges_px = edges_of(image);
  sighting.camera_from_marker = {image.marker->rotation, image.marker->position_m};
  sighting.q = measured_->q + trusted_;
  sighting.q_rate = measured_->rate;
  sighting.path_index = path_.joints.size() - 1;
  return sighting;
}

void EndoscopeRecovery::wait_for_rest(const ServoInput& input) {
  if (!input.image) return;
  const auto seen = sighting_of(*input.image);
  const bool rests =
      seen && !sightings_.empty() && (seen->edges_px - sightings_.front().edges_px).cwiseAbs().maxCoeff() < rest_px;
  if (!rests) {
    sightings_.clear();
    rests_since_s_ = input.image->time_s;
  }
  if (!seen) return;
  add_sighting(*seen, apart_s);
  if (sightings_.size() < min_rest_images || input.image->time_s - rests_since_s_ < rest_s) return;
  // Those before may still show the end of a motion that ends smoothly.
  sightings_.erase(sightings_.begin(), sightings_.end() - min_rest_images);
  phase_ = Phase::exploring;
  explored_s_ = 0;
  seen_s_ = input.time_s;
  motion_ = exploring_motion(limits_, input.joints.q.vector());
}

void EndoscopeRecovery::explore(const ServoInput& input, const ControlStep& step, VisualController& controller) {
  const bool moves = step.action == ControlAction::probe;
  if (moves) explored_s_ += controller.config().period_s;
  const auto seen = input.image ? sighting_of(*input.image) : std::nullopt;
  if (seen) seen_s_ = input.time_s;
  const bool fresh = input.image && input.image->repetition == Repetition::none;
  if (seen && fresh && moves && sightings_.size() < max_images) add_sighting(*seen, apart_s);
  if (input.time_s - seen_s_ > max_lost_s) {
    ++failed_;
    return rest_again(controller);
  }
  if (explored_s_ < motion_.duration_s()) return controller.recover({motion_.velocity(explored_s_)});
  conclude(input, controller);
}

void EndoscopeRecovery::add_sighting(const MarkerSighting& sighting, double min_apart_s) {
  if (!(measured_->stamp_s - sighted_s_ >= min_apart_s)) return;
  sighted_s_ = measured_->stamp_s;
  sightings_.push_back(sighting);
}

void EndoscopeRecovery::conclude(const ServoInput& input, VisualController& controller) {
  const Marker& marker = rig_.instruments.front().marker;
  const auto fit =
      fit_registration(rig_.camera, marker, sightings_, path_, camera_from_rcm_by(marker, sightings_.front()));
  if (!fit || sightings_.size() < min_images || !(fit->rms_px < max_rms_px) || !(fit->sigma_position_m < max_sigma_m) ||
      !(fit->sigma_rotation_rad < max_sigma_rad)) {
    ++failed_;
    return rest_again(controller);
  }
  failed_ = contradicting_ = 0;
  phase_ = Phase::watching;
  camera_from_rcm_ = fit->camera_from_rcm;
  oldest_counted_ = ++registration_;
  refine_at_s_ = {input.time_s + 1.5, input.time_s + 4};
  controller.recovered(feature_model(rig_, fit->camera_from_rcm));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < sightings_.size(); i += refining_each) sightings_[kept++] = sightings_[i];
  sightings_.resize(kept);
}

// Of the images that were seen from here to there, few are enough.
void EndoscopeRecovery::refine(const ServoInput& input, VisualController& controller) {
  if (refine_at_s_.empty()) return;
  if (input.image && input.image->repetition == Repetition::none)
    if (const auto seen = sighting_of(*input.image)) add_sighting(*seen, refining_apart_s);
  if (input.time_s < refine_at_s_.front()) return;
  refine_at_s_.pop_front();
  const auto fit = fit_registration(rig_.camera, rig_.instruments.front().marker, sightings_, path_, *camera_from_rcm_);
  if (!fit || !(fit->rms_px < max_rms_px)) return;
  camera_from_rcm_ = fit->camera_from_rcm;
  ++registration_;
  controller.refine(feature_model(rig_, fit->camera_from_rcm));
}

}  // namespace lapservo::internal
