#pragma once

#include <vector>

#include <benchmark/benchmark.h>
#include <opencv2/core.hpp>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"

namespace lapservo::bench {

/// The standard rig with its camera scaled to an image size, and 1 to 3 instruments: the wider the image, the larger
/// the marker in it. At 1280 pixels of width the marker is about 230 x 97 pixels.
Rig scaled_rig(cv::Size size_px, int instruments);

/// One instrument before a camera whose marker is as large in pixels at every image size: as in scaled_rig's 640.
Rig fixed_marker_rig(cv::Size size_px);

Renderer make_renderer(const Rig& rig);

/// The instruments' configurations in frame `index` of a slow motion, and the placements for the renderer.
std::vector<JointVector> configurations(const Rig& rig, int index);
std::vector<ShaftPlacement> placements(const Rig& rig, int index);

/// Frames of that motion. Each also shows a printed tag of AprilTag's family 36h11 about as large as a marker, so that
/// detectors of tags work on the same frames. Rendered once for each rig.
inline constexpr std::size_t moving_frame_count = 8;
const std::vector<cv::Mat>& moving_frames(const Rig& rig);

/// moving_frames back and forth without end: no jump for a tracker.
const cv::Mat& moving_frame(const std::vector<cv::Mat>& frames, std::size_t index);

/// Arguments of benchmarks: image width and height.
inline cv::Size size_argument(const benchmark::State& state) {
  return {static_cast<int>(state.range(0)), static_cast<int>(state.range(1))};
}

/// A benchmark's loop: calls `work` with the next of these frames each time, of one instrument and the arguments' size.
template <typename Work>
void for_moving_frames(benchmark::State& state, const Work& work) {
  cv::setNumThreads(1);
  const auto& frames = moving_frames(scaled_rig(size_argument(state), 1));
  std::size_t index = 0;
  for (auto _ : state) work(moving_frame(frames, index++));
}

/// The background alone.
const cv::Mat& empty_frame(const Rig& rig);

/// Sets these arguments.
void every_size(benchmark::internal::Benchmark* benchmark);
/// As above, and 1 to 3 instruments as the third argument.
void every_size_and_number(benchmark::internal::Benchmark* benchmark);

}  // namespace lapservo::bench
