#include "lapservo/experiments/stage.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/core/error.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/shaft_lighting.h"

namespace lapservo::internal {
namespace {

constexpr double nearest_m = 0.06, farthest_m = 0.13;
constexpr int candidates = 12;
constexpr ViewLimits well_in_view{.steepest_rad = 0.35, .border_px = 30};

JointVector random_position(const Rig& rig, Random& random) {
  const Instrument& instrument = rig.instruments[0];
  const ViewRange range{nearest_m, farthest_m, well_in_view};
  if (const auto q =
          random_configuration_in_view(rig.camera, instrument.marker, *instrument.camera_from_rcm, range, random))
    return *q;
  throw InputError("rig", "instrument " + instrument.name +
                              " is hardly ever wholly in view between 60 and 130 mm: check camera_from_rcm");
}

}  // namespace

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
  for (const Method method : methods) trackers_.emplace_back(known_exactly(rig), TrackerOptions{method, true});
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

Eigen::Vector2d marker_middle_px(const Camera& camera, const Instrument& instrument, const JointVector& q) {
  const Rigid3 pose = *instrument.camera_from_rcm * rcm_from_unrolled(q);
  return camera.raw_from_point(pose * Eigen::Vector3d(0, 0, instrument.marker.length_m() / 2));
}

std::vector<JointVector> spread_positions(const Rig& rig, int count, Random& random) {
  std::vector<JointVector> chosen;
  std::vector<Eigen::Vector2d> places;
  const auto distance_to_chosen = [&places](const Eigen::Vector2d& place) {
    double least = HUGE_VAL;
    for (const Eigen::Vector2d& other : places) least = std::min(least, (place - other).norm());
    return least;
  };
  for (int i = 0; i < count; ++i) {
    JointVector best;
    Eigen::Vector2d place = Eigen::Vector2d::Zero();
    double farthest = -1;
    for (int k = 0; k < (i == 0 ? 1 : candidates); ++k) {
      const JointVector q = random_position(rig, random);
      const Eigen::Vector2d at = marker_middle_px(rig.camera, rig.instruments[0], q);
      if (const double distance = distance_to_chosen(at); distance > farthest)
        best = q, place = at, farthest = distance;
    }
    chosen.push_back(best);
    places.push_back(place);
  }
  return chosen;
}

}  // namespace lapservo::internal
