#include <benchmark/benchmark.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/test_simulator.h"

namespace lapservo {
using namespace internal;
namespace {

/// One step of the default controller with an image in it, the delay estimated, the model (feature_map) included.
void control_step(benchmark::State& state) {
  testing::Flaws flaws;
  flaws.delay_known = false;
  const ControllerConfig config = testing::test_config(flaws);
  const testing::TestRig rig;
  VisualController controller(config, testing::model_of(rig));
  testing::TestSimulator simulator(rig, flaws, {0.05, 1.57, 0.064, 1}, 1);
  const Trajectory trajectory = sinusoids(paper_sinusoids());
  simulator.run(controller, trajectory, 10);
  double time_s = 20;
  const Eigen::Vector4d q = controller.path().end().position;
  const FeatureState seen = exact_map(rig, q).value();
  ImageMeasurement image;
  image.found = true;
  image.features = seen.features;
  image.ends_px = seen.ends_px;
  image.covariance = Eigen::Vector4d(1e-7, 0.02, 0.02, 0.02).asDiagonal();
  const DesiredFeatures desired = trajectory.at(time_s);
  for (auto _ : state) {
    time_s += config.period_s;
    image.time_s = time_s;
    benchmark::DoNotOptimize(controller.step(time_s, q, image, desired));
  }
}
BENCHMARK(control_step);

}  // namespace
}  // namespace lapservo
