#pragma once

#include <algorithm>

#include <Eigen/Core>

namespace lapservo::internal {

/// Detects readings of `size` numbers that what moves can't have reached since the last ones: a flipped bit, or an
/// encoder that was set. A single outlier is ignored; readings that stay three times in a row are accepted.
template <int size>
class WildReadings {
 public:
  using Vector = Eigen::Matrix<double, size, 1>;

  /// `rate`: the largest usual speeds; up to three times as fast is plausible, where the speed does not jump.
  /// `at_once`: the change that takes no time, by rounding and by times that are not the readings' own.
  WildReadings(const Vector& rate, const Vector& at_once) : rate_(rate), at_once_(at_once) {}

  enum class Verdict {
    plausible,
    wild,
    jumped,  ///< they have stayed where they seemed wild: what was measured before belongs to another place
  };
  /// Times that increase, finite readings.
  Verdict validate(double time_s, const Vector& q) {
    const Reading now{time_s, q};
    const bool plausible = !started_ || (reachable(believed_, now) && goes_on(now));
    staying_ = plausible ? 0 : staying_ > 0 && reachable(latest_, now) ? staying_ + 1 : 1;
    latest_ = now;
    if (!started_) believed_ = now;
    started_ = true;
    if (!plausible && staying_ < believed_after) return Verdict::wild;
    velocity_.setZero();
    interval_s_ = 0;
    if (plausible && now.time_s > believed_.time_s) {
      interval_s_ = now.time_s - believed_.time_s;
      velocity_ = (now.q - believed_.q) / interval_s_;
    }
    believed_ = now;
    return plausible ? Verdict::plausible : Verdict::jumped;
  }
  /// Whether it can have been there then, and its accepted place now.
  bool reaches(double time_s, const Vector& q) const { return reachable({time_s, q}, believed_); }

 private:
  static constexpr int believed_after = 3;

  struct Reading {
    double time_s = 0;
    Vector q = Vector::Zero();
  };
  bool reachable(const Reading& from, const Reading& to) const {
    const Eigen::Array<double, size, 1> way = (to.q - from.q).array().abs();
    return (way <= at_once_.array() + 3 * rate_.array() * (to.time_s - from.time_s)).all();
  }
  // It goes on as it went, within what jitter of the times and a released joint make of it.
  bool goes_on(const Reading& now) const {
    if (!(interval_s_ > 0)) return true;  // not known how it went
    const double interval_s = now.time_s - believed_.time_s;
    // Time that passes while readings are wild makes them no more plausible.
    const double counted_s = staying_ > 0 ? std::min(interval_s, interval_s_) : interval_s;
    const Eigen::Array<double, size, 1> change = (now.q - believed_.q - interval_s * velocity_).array().abs();
    return (change <= at_once_.array() / 2 + counted_s * (rate_ / 2 + velocity_.cwiseAbs()).array()).all();
  }

  Vector rate_, at_once_;
  Reading believed_, latest_;
  Vector velocity_ = Vector::Zero();  // of the accepted readings
  double interval_s_ = 0;             // between the last two that were
  bool started_ = false;
  int staying_ = 0;  // consecutive readings that agree with each other and not with the accepted ones
};

}  // namespace lapservo::internal
