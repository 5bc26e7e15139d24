#include <cmath>

#include <benchmark/benchmark.h>

#include "bench/frames.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {

// A frame period (1/60 s) of the whole simulated simulator with tracking: rendering runs beside it while frames are on
// their way. Argument: threads that render. `x_real_time` is simulated time per real time.
void simulator_period(benchmark::State& state) {
  const Rig rig = scaled_rig({1280, 720}, 1);
  SimulatorConfig config;
  config.arm.joint_offset.setZero();
  config.endoscope.render_threads = static_cast<int>(state.range(0));
  const auto start = configuration_through(*rig.instruments[0].camera_from_rcm, {-0.03, 0.014, 0.095}).value();
  Simulator simulator(rig, config, start);
  Tracker tracker(rig);
  constexpr double period_s = 1.0 / 60;
  for (auto _ : state) {
    const double t = simulator.now_s();
    simulator.servo_jp(start.vector() + Eigen::Vector4d(0.02 * std::sin(t), 0.02 * std::cos(t), 0, 0.5 * std::sin(t)));
    simulator.step(period_s);
    for (const SimulatedFrame& frame : simulator.arrived()) benchmark::DoNotOptimize(tracker.track(frame.picture.bgr));
  }
  state.counters["x_real_time"] =
      benchmark::Counter(static_cast<double>(state.iterations()) * period_s, benchmark::Counter::kIsRate);
}
BENCHMARK(simulator_period)
    ->Arg(0)
    ->Arg(1)
    ->Arg(2)
    ->UseRealTime()
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace lapservo::bench
