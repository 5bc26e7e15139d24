#include <benchmark/benchmark.h>

#include "bench/frames.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {
using namespace internal;
namespace {

int found_in(const std::vector<Observation>& observations) {
  int found = 0;
  for (const Observation& observation : observations) found += observation.status == Status::ok;
  return found;
}

void measure(benchmark::State& state, const Rig& rig, bool single) {
  const auto& frames = moving_frames(rig);
  Tracker tracker(rig, {.method = Method::surface, .single = single});
  tracker.track(frames[0]);
  std::size_t index = 0;
  int found = 0;
  for (auto _ : state) found += found_in(tracker.track(moving_frame(frames, index++)));
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(index * rig.instruments.size());
}

Rig rig_of(const benchmark::State& state) {
  return scaled_rig(size_argument(state), static_cast<int>(state.range(2)));
}

}  // namespace

void cold(benchmark::State& state) {
  measure(state, rig_of(state), true);
}
BENCHMARK(cold)->Apply(every_size_and_number);

void tracked(benchmark::State& state) {
  measure(state, rig_of(state), false);
}
BENCHMARK(tracked)->Apply(every_size_and_number);

void cold_fixed_marker(benchmark::State& state) {
  measure(state, fixed_marker_rig(size_argument(state)), true);
}
BENCHMARK(cold_fixed_marker)->Apply(every_size);

void tracked_fixed_marker(benchmark::State& state) {
  measure(state, fixed_marker_rig(size_argument(state)), false);
}
BENCHMARK(tracked_fixed_marker)->Apply(every_size);

void search_without_marker(benchmark::State& state) {
  const Rig rig = scaled_rig(size_argument(state), 1);
  const cv::Mat& frame = empty_frame(rig);
  Tracker tracker(rig);
  int found = 0;
  for (auto _ : state) found += found_in(tracker.track(frame));
  state.counters["found"] = found;
}
BENCHMARK(search_without_marker)->Apply(every_size);

// The fit to all generatrices alone, from a start some pixels off.
void fit(benchmark::State& state) {
  const Rig rig = scaled_rig(size_argument(state), 1);
  const Instrument& instrument = rig.instruments[0];
  const ImageView image(moving_frames(rig)[0]);
  const auto table = rig.camera.response.table();
  const LightImage light(image, table, ChannelGeometry(rig.camera));
  const ColourClasses classes(rig.instruments);
  Scene scene{image, rig.camera, classes, instrument.marker, classes.of_bands(0)};
  const auto registration = registration_of(instrument);
  scene.registration = &*registration;
  JointVector q = configurations(rig, 0)[0];
  q.theta_rad += 1e-3, q.phi_rad -= 1e-3, q.rho_m += 2e-4, q.psi_rad += 0.01;
  const PoseUnknowns start(pose_through_rcm(*instrument.camera_from_rcm, q), true);
  bool converged = true;
  for (auto _ : state) converged &= fit_finely(scene, light, start, {}).converged;
  state.counters["found"] = converged;
}
BENCHMARK(fit)->Apply(every_size);

}  // namespace lapservo::bench
