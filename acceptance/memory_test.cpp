// Tracking for hours needs no more memory than tracking for minutes: cold, followed, lost and refused frames by turns.
#include <fstream>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "acceptance/frame_sets.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::acceptance::memory_test {

double resident_mb() {
  std::ifstream file("/proc/self/statm");
  long total_pages = 0, resident_pages = 0;
  file >> total_pages >> resident_pages;
  return static_cast<double>(resident_pages) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// LAPSERVO_MEMORY_FRAMES=20000 for the long one.
TEST(Memory, IsFlatOverManyFrames) {
  RenderedSet set;
  set.rig = example_rig();
  set.configurations = random_configurations(set.rig, 6, 1, 0.35);
  std::vector<cv::Mat> frames;
  for (const TrueFrame& frame : rendered_frames(set)) frames.push_back(frame.bgr);
  frames.push_back(cv::Mat(frames[0].size(), CV_8UC3, cv::Scalar(40, 50, 120)));
  frames.push_back(frames[0].clone());
  cv::GaussianBlur(frames.back(), frames.back(), {}, 12);
  Tracker tracker(set.rig);
  const int count = from_environment("LAPSERVO_MEMORY_FRAMES", 1200);
  int found = 0;
  double settled_mb = 0;
  for (int i = 0; i < count; ++i) {
    const cv::Mat& frame = frames[static_cast<std::size_t>(i / 4) % frames.size()];  // each four times: followed too
    found += tracker.track(frame)[0].status == Status::ok;
    if (i == count / 10) settled_mb = resident_mb();
  }
  EXPECT_GT(found, count / 2);
  EXPECT_LT(resident_mb(), settled_mb + 2);
}

}  // namespace lapservo::acceptance::memory_test
