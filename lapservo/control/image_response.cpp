#include "lapservo/control/image_response.h"

#include <cmath>
#include <limits>
#include <utility>

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {
namespace {

// A step of the image, from one to the next, that no joint has made.
const Eigen::Array4d jump(0.03, 0.03, 0.003, 0.1);
// Path beyond the backlash (rad, m) over which a slope is tested, and the motion of a joint that can be confirmed.
const Eigen::Array4d tested(5e-3, 5e-3, 8e-4, 0.015), confirming(1.5e-3, 1.5e-3, 2.5e-4, 8e-3);
// An unconfirmed joint goes at most so fast: in 0.3 s, the longest delay, 10 mrad, 1.2 mm, 24 mrad.
const Eigen::Array4d slow(0.035, 0.035, 0.004, 0.08);
constexpr double slow_fraction = 0.1;  // and of its rate limit

constexpr double half = 0.5, sure = 3;  // slope; standard deviations
constexpr double alike_images = 2;      // neighbouring images share part of their errors
// What a wrong model makes of other joints' motion: a part of it, of what the Jacobian's elements make of it, and in
// joint scales; for a joint to be confirmed, and at most.
constexpr double usual_error = 0.15, usually_mixed = 0.1, most_mixed = 0.4;
constexpr double learnt_within = 0.5;  // joint scales of motion
constexpr double points_tested = 8;    // of the path that is tested
constexpr double backlash_part = 0.4;  // of the widest that is looked for

}  // namespace

Eigen::Vector4d ImageResponse::longest_path() {
  return {0.018, 0.018, 0.0027, 0.09};
}

Eigen::Vector4d ImageResponse::unconfirmed_rate(const JointLimits& limits) {
  return (slow_fraction * limits.rate.array()).min(slow);
}

ImageResponse::ImageResponse(const ControllerConfig& config)
    : config_(config), backlash_(backlash_part * config.observer.backlash.largest.array()) {}

void ImageResponse::restart() {
  unanswered_.reset();
  doubt();
}

void ImageResponse::doubt() {
  confirmed_.fill(false);
  interrupt();
}

void ImageResponse::interrupt() {
  started_ = false;
  size_ = 0;
}

Eigen::Vector4d ImageResponse::rate() const {
  Eigen::Vector4d rate = unconfirmed_rate(config_.limits);
  for (Eigen::Index i = 0; i < 4; ++i)
    if (confirmed_[static_cast<std::size_t>(i)]) rate[i] = config_.limits.rate[i];
  return rate;
}

void ImageResponse::add(const ImageMeasurement& image, const Eigen::Matrix4d& jacobian, const JointHistory& history) {
  if (history.size() == 0 || !jacobian.allFinite()) return;
  std::array<Eigen::Vector4d, delays> q;
  for (std::size_t i = 0; i < delays; ++i)
    q[i] = *history.at(std::max(history.oldest_s(), image.time_s - delay_step_s * static_cast<double>(i)));
  // A Jacobian that is being learnt follows slowly, so that it does not explain a fault away.
  const double moved = (q[0] - q_[0]).cwiseQuotient(config_.scales.joints).norm();
  jacobian_ =
      started_ ? Eigen::Matrix4d(jacobian_ - std::expm1(-moved / learnt_within) * (jacobian - jacobian_)) : jacobian;
  const Eigen::Matrix4d inverse = damped_inverse(jacobian_, config_.scales, config_.damping_threshold).inverse;
  mixed_ = (inverse.cwiseAbs2() * jacobian_.cwiseAbs2()).cwiseSqrt();
  now_.variance = (inverse * image.covariance * inverse.transpose()).diagonal();
  const Eigen::Vector4d stepped = inverse * feature_error(image.features, features_);
  if (started_ && (stepped.array().abs() > jump + (q[0] - q_[0]).array().abs()).any()) doubt();
  if (started_) {
    // A direction that the features hardly show is damped in both.
    const Eigen::Matrix4d shown = inverse * jacobian_;
    now_.seen += stepped;
    for (std::size_t i = 0; i < delays; ++i) {
      now_.moved[i] += shown * (q[i] - q_[i]);
      const Eigen::Array4d at = now_.moved[i].array();
      now_.driven[i] = now_.driven[i].array().max(at - backlash_).min(at + backlash_);
    }
  } else {
    now_.seen.setZero();
    now_.moved.fill(Eigen::Vector4d::Zero());
    now_.driven = now_.moved;
  }
  features_ = image.features;
  q_ = q;
  const auto far = [&](std::size_t delay) {
    return ((now_.moved[delay] - point(0).moved[delay]).array().abs() * points_tested >= tested).any();
  };
  if (started_ && !far(0) && !far(delays - 1)) return;
  started_ = true;
  ring_[next_] = now_;
  next_ = (next_ + 1) % points;
  size_ = std::min(size_ + 1, points);
  test();
}

void ImageResponse::Sums::add(const Eigen::Array4d& at, const Eigen::Array4d& seen, const Eigen::Array4d& counts) {
  count += counts;
  x += counts * at, y += counts * seen, xx += counts * at * at, xy += counts * at * seen;
  lower = lower.min(counts * at), upper = upper.max(counts * at);
}

// The side to which a joint presses against its backlash: 1, -1, or 0 in between; 2 where it has none.
Eigen::Array4d ImageResponse::pressed(const Point& at, std::size_t delay) const {
  constexpr double nearly = 0.999;
  const Eigen::Array4d lead = (at.moved[delay] - at.driven[delay]).array();
  const auto against = [&](const Eigen::Array4d& side) { return (side > nearly * backlash_).cast<double>(); };
  return (backlash_ > 0).select(against(lead) - against(-lead), 2.0);
}

// nullopt where the joint has moved less than `path`.
std::optional<ImageResponse::Slope> ImageResponse::slope(const Sums& sums, Eigen::Index joint, double variance,
                                                         double path) const {
  Eigen::Vector4d range = sums.upper - sums.lower;
  const double own = std::exchange(range[joint], 0), count = sums.count[joint];
  if (!(own > path)) return std::nullopt;
  const double squares = sums.xx[joint] - sums.x[joint] * sums.x[joint] / count;
  const double scale = config_.scales.joints[joint];
  return Slope{(sums.xy[joint] - sums.x[joint] * sums.y[joint] / count) / squares,
               sure * std::sqrt(alike_images * variance / squares), mixed_.row(joint).dot(range) / own,
               scale * range.cwiseQuotient(config_.scales.joints).maxCoeff() / own};
}

bool ImageResponse::is_unanswered(const std::array<Sums, delays>& sums, Eigen::Index joint, double variance) {
  std::size_t& likely = likely_[static_cast<std::size_t>(joint)];
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < delays; ++k) {
    const std::size_t delay = (likely + k) % delays;
    const auto found = slope(sums[delay], joint, variance, tested[joint]);
    if (!found) return false;
    if (!(found->value + found->error(config_.model_error, most_mixed) < half)) {
      likely = delay;
      return false;
    }
    largest = std::max(largest, found->value);
  }
  unanswered_ = Unanswered{joint, largest};
  return true;
}

void ImageResponse::test() {
  std::array<Sums, delays> free, bound;  // as if without backlash; pressed to one side, beyond it
  std::array<Eigen::Array4d, delays> side, open;
  for (std::size_t i = 0; i < delays; ++i) side[i] = pressed(now_, i), open[i] = (side[i] != 0).cast<double>();
  Eigen::Vector4d variance = Eigen::Vector4d::Zero();
  for (std::size_t back = 0; back < size_ && !unanswered_; ++back) {
    const Point& then = point(back);
    const bool all_confirmed = std::all_of(confirmed_.begin(), confirmed_.end(), [](bool one) { return one; });
    variance += (then.variance - variance) / static_cast<double>(back + 1);
    const Eigen::Array4d seen = (then.seen - now_.seen).array();
    for (std::size_t i = 0; i < delays; ++i) {
      open[i] *= (pressed(then, i) == side[i]).cast<double>();
      bound[i].add((then.driven[i] - now_.driven[i]).array(), seen, open[i]);
      if (!all_confirmed) free[i].add((then.moved[i] - now_.moved[i]).array(), seen, Eigen::Array4d::Ones());
    }
    for (Eigen::Index joint = 0; joint < 4; ++joint) {
      bool& confirmed = confirmed_[static_cast<std::size_t>(joint)];
      const auto confirms = [&](const Sums& sums) {
        const auto found = slope(sums, joint, variance[joint], confirming[joint]);
        return found && found->value - found->error(usual_error, usually_mixed) > half;
      };
      confirmed = confirmed || std::any_of(free.begin(), free.end(), confirms);
      if (is_unanswered(bound, joint, variance[joint])) break;
    }
  }
}

}  // namespace lapservo::internal
