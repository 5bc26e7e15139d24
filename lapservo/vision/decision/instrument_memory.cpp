#include "lapservo/vision/decision/instrument_memory.h"

namespace lapservo::internal {

PoseUnknowns InstrumentMemory::expected_pose(double at_s) const {
  constexpr double most_steps = 4;  // hands and arms do not move evenly for longer
  const double steps = step_s > 0 ? std::clamp((at_s - time_s) / step_s, 0.0, most_steps) : 0;
  return last.changed_by(steps * step);
}

Expected InstrumentMemory::expected(double at_s) const {
  Expected expected{looks.is_due(), bias_px, departure, blur.boundaries_px()};
  if (step_s > 0) expected.moved_on = expected_pose(at_s);
  return expected;
}

InstrumentMemory remembered(const std::optional<InstrumentMemory>& before, const FineFit& fit, bool among_others,
                            double time_s) {
  InstrumentMemory memory{.time_s = time_s,
                          .last = fit.unknowns,
                          .step = PoseVector::Zero(),
                          .blur = fit.blur,
                          .looks = before ? before->looks : LookSchedule{},
                          .bias_px = fit.bias_px,
                          .departure = fit.departure,
                          .among_others = among_others};
  fit.asked ? memory.looks.looked(fit.processing, fit.processing_explained > 0) : memory.looks.passed();
  if (before && before->last.through_rcm() == fit.unknowns.through_rcm()) {
    memory.step = before->last.change_to(fit.unknowns);
    memory.step_s = time_s - before->time_s;
  }
  return memory;
}

}  // namespace lapservo::internal
