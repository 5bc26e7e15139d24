#pragma once

namespace lapservo::internal {

/// Backlash of one joint: the motor takes the instrument along only when it presses against one side of a gap. The
/// state does not depend on the gap's width (the turning point and the side pressed since), so that the width may
/// change while it is being learnt.
class Backlash {
 public:
  /// The instrument in the middle of the gap, or with the motor pressed against a side: 1 after rising, -1 after
  /// falling.
  explicit Backlash(double motor = 0, int side = 0) : turned_at_(motor), side_(side) {}

  void follow(double motor, double width) {
    const double left = motor - turned_at_;
    if (side_ == 0 && (left > width / 2 || left < -width / 2)) {
      press(motor, left > 0 ? 1 : -1);
    } else if (side_ != 0 && (left * side_ >= 0 || left * side_ < -width)) {
      press(motor, left > 0 ? 1 : left < 0 ? -1 : side_);
    }
  }
  /// Where the instrument is, on the motor's scale; with `width` as in the last follow().
  double instrument(double width) const { return turned_at_ - side_ * width / 2; }

 private:
  void press(double motor, int side) {
    turned_at_ = motor;
    side_ = side;
  }

  double turned_at_;
  int side_;
};

}  // namespace lapservo::internal
