#include "lapservo/vision/memory/print_record.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

constexpr const PrintRecordLimits& limits = print_record_limits;

// 0 to sides - 1.
std::size_t side_of(double tau_rad, std::size_t sides) {
  const auto side = static_cast<std::size_t>(wrap_two_pi(tau_rad) / two_pi * static_cast<double>(sides));
  return std::min(side, sides - 1);
}

}  // namespace

bool shows_the_rigs_print(const FineFit& fit) {
  const int fewest = *std::min_element(fit.used.begin(), fit.used.end());
  return fewest > limits.wholly_located * fit.lines && fit.far_off_probability < limits.most_far_off &&
         fit.inner_off_m < limits.most_inner_off_m;
}

void PrintRecord::begin_frame(double time_s) {
  if (time_s - seen_s_ > limits.exchange_s) *this = PrintRecord();
  now_s_ = time_s;
}

void PrintRecord::add(double tau_rad, View view) {
  seen_s_ = now_s_;
  View& known = views_[side_of(tau_rad, sides)];
  if (!(view == View::possible && known == View::the_rigs)) known = view;
}

bool PrintRecord::is_the_rigs(double tau_rad) const {
  if (std::count(views_.begin(), views_.end(), View::off) > 0) return false;
  const auto reach = [](double rad) { return static_cast<std::size_t>(std::lround(rad / two_pi * sides)); };
  const auto seen_within = [&](std::size_t steps) {
    std::size_t seen = 0;
    const std::size_t first = side_of(tau_rad, sides) + sides - steps;
    for (std::size_t i = 0; i <= 2 * steps; ++i) seen += views_[(first + i) % sides] == View::the_rigs;
    return seen;
  };
  return seen_within(reach(limits.near_rad)) >= 1 && seen_within(reach(limits.in_view_rad)) >= 2;
}

bool PrintRecord::is_off() const {
  const auto off = std::count(views_.begin(), views_.end(), View::off);
  const auto unseen = std::count(views_.begin(), views_.end(), View::unseen);
  const auto others = static_cast<std::ptrdiff_t>(sides) - unseen - off;
  return off >= limits.least_off_sides && off > limits.off_for_others * others;
}

}  // namespace lapservo::internal
