#include "lapservo/vision/decision/instrument_memory.h"

#include <cstddef>

namespace lapservo::internal {

PoseUnknowns InstrumentMemory::expected_pose(double at_s) const {
  constexpr double most_steps = 4;  // hands and arms do not move evenly for longer
  const double steps = step_s > 0 ? std::clamp((at_s - time_s) / step_s, 0.0, most_steps) : 0;
  return fit.unknowns.changed_by(steps * step);
}

Expected InstrumentMemory::expected(double at_s) const {
  Expected expected{looks.is_due(), fit.blur, fit.bias_px, fit.departure};
  if (step_s > 0) expected.moved_on = expected_pose(at_s);
  return expected;
}

InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, double time_s) {
  InstrumentMemory memory{time_s, fit, before ? before->looks : LookSchedule{}};
  fit.asked ? memory.looks.looked(fit.processing, fit.processing_explained > 0) : memory.looks.passed();
  if (before && before->fit.unknowns.through_rcm() == fit.unknowns.through_rcm()) {
    memory.step = before->fit.unknowns.change_to(fit.unknowns);
    memory.step_s = time_s - before->time_s;
  }
  return memory;
}

bool shows_the_rigs_print(const FineFit& fit) {
  const int fewest = *std::min_element(fit.used.begin(), fit.used.end());
  return fewest > print_record_limits.wholly_located * fit.lines && fit.p_false < print_limits.fraction_of_known;
}

void PrintRecord::begin_frame(double time_s) {
  if (time_s - seen_s_ > print_record_limits.exchange_s) *this = PrintRecord();
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
  const auto seen_within = [&](std::size_t side, std::size_t steps) {
    std::size_t seen = 0;
    for (std::size_t i = 0; i <= 2 * steps; ++i)
      seen += views_[(side + print_sides - steps + i) % print_sides] == View::the_rigs;
    return seen;
  };
  for (std::size_t side = 0; side < print_sides; ++side)
    known[side] = seen_within(side, print_record_limits.near_sides) >= 1 &&
                  seen_within(side, print_record_limits.in_view_sides) >= 2;
  return known;
}

bool PrintRecord::is_off() const {
  const auto off = std::ranges::count(views_, View::off);
  const auto others = static_cast<std::ptrdiff_t>(print_sides) - std::ranges::count(views_, View::unseen) - off;
  return off >= print_record_limits.least_off_sides && off > print_record_limits.off_for_others * others;
}

}  // namespace lapservo::internal
