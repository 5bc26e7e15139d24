#include "lapservo/vision/memory/instrument_memory.h"

#include <algorithm>

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

LookSchedule schedule_after(const FineFit& fit, LookSchedule schedule) {
  if (fit.asked)
    schedule.looked(fit.processing, fit.processing_explained > 0);
  else
    schedule.passed();
  return schedule;
}

}  // namespace

UnknownVector InstrumentMemory::expected_step(double at_s) const {
  constexpr double most_steps = 4;  // hands and arms do not move evenly for longer
  const double steps = step_s > 0 ? std::clamp((at_s - time_s) / step_s, 0.0, most_steps) : 0;
  return steps * step;
}

PoseUnknowns InstrumentMemory::expected_pose(double at_s) const {
  return last.changed_by(expected_step(at_s));
}

std::optional<double> InstrumentMemory::turn_change_rad(const PoseUnknowns& unknowns, double at_s) const {
  if (!(step_s > 0) || !unknowns.q()) return std::nullopt;
  const double expected_rad = last.q()->psi_rad + expected_step(at_s)[unknowns.size() - 1];
  return wrap_pi(unknowns.q()->psi_rad - expected_rad);
}

InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, bool among_others,
                            double time_s) {
  InstrumentMemory memory{.time_s = time_s,
                          .last = fit.unknowns,
                          .step = UnknownVector::Zero(fit.unknowns.size()),
                          .blur = fit.blur,
                          .looks = schedule_after(fit, before ? before->looks : LookSchedule{}),
                          .bias_px = fit.bias_px,
                          .departure = fit.departure,
                          .among_others = among_others};
  if (before && before->last.q() && fit.unknowns.q()) {
    memory.step = fit.unknowns.q()->vector() - before->last.q()->vector();
    memory.step_s = time_s - before->time_s;
  }
  return memory;
}

}  // namespace lapservo::internal
