#include "lapservo/vision/decision/print_record.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

constexpr const PrintRecordLimits& limits = print_record_limits;

}  // namespace

bool shows_the_rigs_print(const FineFit& fit) {
  const int fewest = *std::min_element(fit.used.begin(), fit.used.end());
  return fewest > limits.wholly_located * fit.lines && fit.p_false < limits.most_p_false;
}

void PrintRecord::begin_frame(double time_s) {
  if (time_s - seen_s_ > limits.exchange_s) *this = PrintRecord();
  now_s_ = time_s;
}

void PrintRecord::add(double tau_rad, View view) {
  seen_s_ = now_s_;
  View& known = views_[print_side(tau_rad)];
  if (!(view == View::possible && known == View::the_rigs)) known = view;
}

PrintSides PrintRecord::known_sides() const {
  PrintSides known;
  if (std::ranges::count(views_, View::off) > 0 || std::ranges::count(views_, View::the_rigs) < 2) return known;
  const auto reach = [](double rad) { return static_cast<std::size_t>(std::lround(rad / two_pi * print_sides)); };
  const auto seen_within = [&](std::size_t side, std::size_t steps) {
    std::size_t seen = 0;
    for (std::size_t i = 0; i <= 2 * steps; ++i)
      seen += views_[(side + print_sides - steps + i) % print_sides] == View::the_rigs;
    return seen;
  };
  for (std::size_t side = 0; side < print_sides; ++side)
    known[side] = seen_within(side, reach(limits.near_rad)) >= 1 && seen_within(side, reach(limits.in_view_rad)) >= 2;
  return known;
}

bool PrintRecord::is_off() const {
  const auto off = std::ranges::count(views_, View::off);
  const auto others = static_cast<std::ptrdiff_t>(print_sides) - std::ranges::count(views_, View::unseen) - off;
  return off >= limits.least_off_sides && off > limits.off_for_others * others;
}

}  // namespace lapservo::internal
