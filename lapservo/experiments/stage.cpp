#include "lapservo/experiments/stage.h"

#include "lapservo/core/random.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/shaft_lighting.h"

namespace lapservo::internal {

Stage::Stage(const Rig& rig, cv::Mat tissue) : rig_(rig), tissue_(std::move(tissue)) {}

cv::Mat Stage::render(const JointVector& q, double lamp_power, std::uint64_t seed) {
  const Instrument& instrument = rig_.instruments[0];
  if (!renderer_ || lamp_power != lamp_power_) {
    const double lamps_fraction = (1 - ambient_fraction) * lamp_power;
    RenderOptions options;
    options.lighting.ambient = static_cast<float>(ambient_fraction) * options.lighting.diffuse;
    options.lighting = at_power(options.lighting, static_cast<float>(lamps_fraction));
    renderer_ = std::make_unique<Renderer>(rig_.camera, std::vector{shaft_of(instrument)},
                                           tissue_ * (lamps_fraction + ambient_fraction), options);
    lamp_power_ = lamp_power;
  }
  return renderer_->render({placement_of(instrument, q)}, seed);
}

Eyes::Eyes(const Rig& rig, const std::vector<Method>& methods) {
  for (const Method method : methods) trackers_.emplace_back(rig, TrackerOptions{method, true});
}

std::vector<Observation> Eyes::observe(const cv::Mat& frame) {
  std::vector<Observation> observations;
  for (Tracker& tracker : trackers_) observations.push_back(tracker.track(frame)[0]);
  return observations;
}

std::uint64_t frame_seed(std::uint64_t experiment_seed, int frame) {
  Random random(experiment_seed);
  return random.bits() + static_cast<std::uint64_t>(frame);
}

}  // namespace lapservo::internal
