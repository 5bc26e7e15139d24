#include <benchmark/benchmark.h>
#include <opencv2/aruco.hpp>

#include "bench/frames.h"

namespace lapservo::bench {

// OpenCV's detector with its usual settings, looking for the same tag.
void aruco(benchmark::State& state) {
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const auto parameters = cv::aruco::DetectorParameters::create();
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  std::size_t found = 0;
  for_moving_frames(state, [&](const cv::Mat& frame) {
    cv::aruco::detectMarkers(frame, dictionary, corners, ids, parameters);
    found += ids.size();
  });
  state.counters["found"] = benchmark::Counter(static_cast<double>(found), benchmark::Counter::kAvgIterations);
}
BENCHMARK(aruco)->Apply(every_size);

}  // namespace lapservo::bench
