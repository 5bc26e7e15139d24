#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "bench/frames.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {
namespace {

int found_in(const std::vector<Observation>& observations) {
  int found = 0;
  for (const Observation& observation : observations) found += observation.status == Status::ok;
  return found;
}

void measure(benchmark::State& state, bool single) {
  const Rig rig = scaled_rig(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  const auto frames = moving_frames(rig, 16);
  Tracker tracker(rig, {.method = Method::surface, .single = single});
  tracker.track(frames[0]);
  std::size_t index = 0;
  int found = 0, frames_seen = 0;
  for (auto _ : state) {
    // Back and forth: no jump for the tracker.
    const std::size_t place = index % 30;
    found += found_in(tracker.track(frames[place < 16 ? place : 30 - place]));
    ++index, ++frames_seen;
  }
  state.counters["found"] = static_cast<double>(found) / (frames_seen * static_cast<double>(rig.instruments.size()));
}

}  // namespace

// Arguments: image width, instruments.
void cold(benchmark::State& state) {
  measure(state, true);
}
void tracked(benchmark::State& state) {
  measure(state, false);
}
BENCHMARK(cold)->ArgsProduct({{640, 1280, 1920, 3840}, {1, 2, 3}})->Unit(benchmark::kMillisecond);
BENCHMARK(tracked)->ArgsProduct({{640, 1280, 1920, 3840}, {1, 2, 3}})->Unit(benchmark::kMillisecond);

void search_without_marker(benchmark::State& state) {
  const Rig rig = scaled_rig(static_cast<int>(state.range(0)), 1);
  const cv::Mat frame = empty_frame(rig);
  Tracker tracker(rig);
  for (auto _ : state) benchmark::DoNotOptimize(tracker.track(frame));
}
BENCHMARK(search_without_marker)->Arg(1280)->Arg(1920)->Unit(benchmark::kMillisecond);

void copy_frame(benchmark::State& state) {
  const cv::Mat frame = empty_frame(scaled_rig(static_cast<int>(state.range(0)), 1));
  cv::Mat copy(frame.size(), frame.type());
  for (auto _ : state) {
    frame.copyTo(copy);
    benchmark::DoNotOptimize(copy.data);
  }
}
BENCHMARK(copy_frame)->Arg(640)->Arg(1280)->Arg(1920)->Arg(3840)->Unit(benchmark::kMillisecond);

void hsv_of_frame(benchmark::State& state) {
  cv::setNumThreads(1);
  const cv::Mat frame = empty_frame(scaled_rig(static_cast<int>(state.range(0)), 1));
  cv::Mat hsv;
  for (auto _ : state) {
    cv::cvtColor(frame, hsv, cv::COLOR_BGR2HSV);
    benchmark::DoNotOptimize(hsv.data);
  }
}
BENCHMARK(hsv_of_frame)->Arg(1280)->Arg(1920)->Unit(benchmark::kMillisecond);

}  // namespace lapservo::bench
