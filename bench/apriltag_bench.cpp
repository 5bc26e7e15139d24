#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <memory>

#include <benchmark/benchmark.h>
#include <opencv2/imgproc.hpp>

#include "bench/frames.h"

namespace lapservo::bench {
namespace {

// From the BGR frame on, as all others: the conversion to grey is part of the price.
void apriltag(benchmark::State& state, float decimate) {
  const std::unique_ptr<apriltag_family_t, decltype(&tag36h11_destroy)> family(tag36h11_create(), tag36h11_destroy);
  const std::unique_ptr<apriltag_detector_t, decltype(&apriltag_detector_destroy)> detector(apriltag_detector_create(),
                                                                                            apriltag_detector_destroy);
  apriltag_detector_add_family(detector.get(), family.get());
  detector->nthreads = 1;
  detector->quad_decimate = decimate;
  cv::Mat grey;
  int found = 0;
  for_moving_frames(state, [&](const cv::Mat& frame) {
    cv::cvtColor(frame, grey, cv::COLOR_BGR2GRAY);
    image_u8_t image{grey.cols, grey.rows, static_cast<int>(grey.step[0]), grey.data};
    zarray_t* detections = apriltag_detector_detect(detector.get(), &image);
    found += zarray_size(detections);
    apriltag_detections_destroy(detections);
  });
  state.counters["found"] = benchmark::Counter(found, benchmark::Counter::kAvgIterations);
}

}  // namespace

BENCHMARK_CAPTURE(apriltag, decimate_1, 1.0F)->Apply(every_size);
BENCHMARK_CAPTURE(apriltag, decimate_2, 2.0F)->Apply(every_size);

}  // namespace lapservo::bench
