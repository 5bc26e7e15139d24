#include <benchmark/benchmark.h>
#include <opencv2/aruco.hpp>

#include "bench/frames.h"

namespace lapservo::bench {

// OpenCV's detector with its usual settings, looking for the same tag.
void aruco(benchmark::State& state) {
  cv::setNumThreads(1);
  const auto& frames = moving_frames(scaled_rig(size_argument(state), 1));
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const auto parameters = cv::aruco::DetectorParameters::create();
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  std::size_t index = 0, found = 0;
  for (auto _ : state) {
    cv::aruco::detectMarkers(moving_frame(frames, index++), dictionary, corners, ids, parameters);
    found += ids.size();
  }
  state.counters["found"] = static_cast<double>(found) / static_cast<double>(index);
}
BENCHMARK(aruco)->Apply(every_size);

}  // namespace lapservo::bench
