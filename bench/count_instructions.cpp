// Work to be counted under callgrind. `render FOLDER` draws the frames, at full speed. `cold`, `tracked`,
// `tracked_narrow` and `tracked_wide FOLDER` track them; only counted_work() counts (--toggle-collect). narrow and wide
// are a marker of the same size in pixels in images of 640 and 3840 pixels of width, in as many frames as
// LookSchedule's longest pause.
#include <cstdio>
#include <string>
#include <vector>

#include <opencv2/imgcodecs.hpp>

#include "bench/frames.h"
#include "lapservo/vision/tracker.h"

namespace {

using lapservo::Rig;

struct Work {
  const char* name;
  Rig rig;
  bool single;
  int warm_up, counted;
};

std::vector<Work> all_work() {
  using lapservo::bench::fixed_marker_rig, lapservo::bench::scaled_rig;
  return {{"cold", scaled_rig({1920, 1080}, 1), true, 2, 1},
          {"tracked", scaled_rig({1920, 1080}, 1), false, 2, 1},
          {"tracked_narrow", fixed_marker_rig({640, 480}), false, 192, 64},
          {"tracked_wide", fixed_marker_rig({3840, 2160}), false, 192, 64}};
}

std::string file_of(const std::string& folder, const Work& work, std::size_t frame) {
  return folder + "/" + work.name + std::to_string(frame) + ".bmp";
}

bool render(const std::string& folder) {
  for (const Work& work : all_work()) {
    const std::vector<cv::Mat>& frames = lapservo::bench::moving_frames(work.rig);
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (!cv::imwrite(file_of(folder, work, i), frames[i])) return false;
  }
  return true;
}

}  // namespace

extern "C" __attribute__((noinline)) bool counted_work(lapservo::Tracker* tracker, const cv::Mat* frame) {
  return tracker->track(*frame)[0].status == lapservo::Status::ok;
}

namespace {

bool track(const std::string& folder, const Work& work) {
  std::vector<cv::Mat> frames;
  for (std::size_t i = 0; i < lapservo::bench::moving_frame_count; ++i)
    frames.push_back(cv::imread(file_of(folder, work, i)));
  lapservo::Tracker tracker(work.rig, {.single = work.single});
  std::size_t index = 0;
  for (int i = 0; i < work.warm_up; ++i) tracker.track(lapservo::bench::moving_frame(frames, index++));
  bool found = true;
  for (int i = 0; i < work.counted; ++i)
    found &= counted_work(&tracker, &lapservo::bench::moving_frame(frames, index++));
  return found;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3)
    return std::fputs("count_instructions render|cold|tracked|tracked_narrow|tracked_wide FOLDER\n", stderr), 2;
  const std::string what = argv[1], folder = argv[2];
  if (what == "render") return render(folder) ? 0 : 1;
  for (const Work& work : all_work())
    if (what == work.name) return track(folder, work) ? 0 : 1;
  return 2;
}
