// The cost of other operations on the same frames: copying them, converting their colours, and finding other markers.
#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "bench/frames.h"

namespace lapservo::bench {

void copy_frame(benchmark::State& state) {
  cv::Mat copy(size_argument(state), CV_8UC3);
  for_moving_frames(state, [&](const cv::Mat& frame) {
    frame.copyTo(copy);
    benchmark::DoNotOptimize(copy.data);
  });
}
BENCHMARK(copy_frame)->Apply(every_size);

void hsv_of_frame(benchmark::State& state) {
  cv::Mat hsv;
  for_moving_frames(state, [&](const cv::Mat& frame) {
    cv::cvtColor(frame, hsv, cv::COLOR_BGR2HSV);
    benchmark::DoNotOptimize(hsv.data);
  });
}
BENCHMARK(hsv_of_frame)->Apply(every_size);

// The textbook's way to three colours: HSV, a range for each hue, opening, connected components. It ends with boxes,
// where the marker's pose would begin.
void textbook(benchmark::State& state) {
  const cv::Mat element = cv::getStructuringElement(cv::MORPH_ELLIPSE, {5, 5});
  cv::Mat hsv, mask, labels, boxes, centres;
  int components = 0;
  for_moving_frames(state, [&](const cv::Mat& frame) {
    cv::cvtColor(frame, hsv, cv::COLOR_BGR2HSV);
    for (const int half_hue_deg : {45, 90, 135}) {
      cv::inRange(hsv, cv::Scalar(half_hue_deg - 15, 60, 40), cv::Scalar(half_hue_deg + 15, 255, 255), mask);
      cv::morphologyEx(mask, mask, cv::MORPH_OPEN, element);
      components += cv::connectedComponentsWithStats(mask, labels, boxes, centres) - 1;
    }
  });
  state.counters["components"] = benchmark::Counter(components, benchmark::Counter::kAvgIterations);
}
BENCHMARK(textbook)->Apply(every_size);

}  // namespace lapservo::bench
