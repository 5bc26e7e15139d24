// Work to be counted under callgrind: render FOLDER draws the frames (at full speed, not counted); cold FOLDER and
// tracked FOLDER see them, the last one inside counted_work, which alone counts (--toggle-collect).
#include <cstdio>
#include <string>

#include <opencv2/imgcodecs.hpp>

#include "bench/frames.h"
#include "lapservo/vision/tracker.h"

namespace {

constexpr int warm_up = 2;
const cv::Size size_px{1920, 1080};

std::string name_of(const std::string& folder, int frame) {
  return folder + "/" + std::to_string(frame) + ".bmp";
}

int render(const lapservo::Rig& rig, const std::string& folder) {
  lapservo::Renderer renderer = lapservo::bench::make_renderer(rig);
  for (int i = 0; i <= warm_up; ++i) {
    const auto frame = renderer.render(lapservo::bench::placements(rig, i), static_cast<std::uint64_t>(i));
    if (!cv::imwrite(name_of(folder, i), frame)) return 1;
  }
  return 0;
}

}  // namespace

extern "C" __attribute__((noinline)) bool counted_work(lapservo::Tracker* tracker, const cv::Mat* frame) {
  return tracker->track(*frame)[0].status == lapservo::Status::ok;
}

int main(int argc, char** argv) {
  if (argc != 3) return std::fputs("count_instructions render|cold|tracked FOLDER\n", stderr), 2;
  const std::string what = argv[1], folder = argv[2];
  const lapservo::Rig rig = lapservo::bench::scaled_rig(size_px, 1);
  if (what == "render") return render(rig, folder);
  lapservo::Tracker tracker(rig, {.single = what == "cold"});
  for (int i = 0; i < warm_up; ++i) tracker.track(cv::imread(name_of(folder, i)));
  const cv::Mat frame = cv::imread(name_of(folder, warm_up));
  return counted_work(&tracker, &frame) ? 0 : 1;
}
