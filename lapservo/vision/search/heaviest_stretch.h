#pragma once

namespace lapservo::internal {

/// Neighbouring places, first to last; none when last < first.
template <typename Sum>
struct Stretch {
  int first = 0, last = -1;
  Sum sum = 0;
};

/// The stretch of [begin, end) with the largest sum of gain(i) (maximum subarray); none when no gain is positive.
template <typename Gain>
auto heaviest_stretch(int begin, int end, const Gain& gain) {
  using Sum = decltype(gain(begin));
  Stretch<Sum> best;
  Sum sum = 0;
  int first = begin;
  for (int i = begin; i < end; ++i) {
    sum += gain(i);
    if (sum <= 0) {
      sum = 0;
      first = i + 1;
    } else if (sum > best.sum) {
      best = {first, i, sum};
    }
  }
  return best;
}

}  // namespace lapservo::internal
