#include "lapservo/calibration/camera/camera_measurement.h"

#include <optional>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

// A video of flat images.
class FlatVideo : public FrameSource {
 public:
  FlatVideo(int frames, double fps) : frames_(frames), fps_(fps) {}
  std::optional<Frame> next() override {
    if (index_ == frames_) return std::nullopt;
    return Frame{picture_, index_, index_++ / fps_, {}, {}};
  }
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override { return frames_; }
  double frames_per_second() const override { return fps_; }

 private:
  int frames_, index_ = 0;
  double fps_;
  cv::Mat picture_ = cv::Mat(48, 64, CV_8UC3, cv::Scalar(90, 100, 110));
};

int looked_at(int frames, double fps) {
  BoardRecordings recordings({}, 30, std::nullopt);
  FlatVideo video(frames, fps);
  recordings.look_at(video, "video", {});
  return recordings.read().looked_at;
}

// Finding a board's corners takes long: four frames a second suffice, and of long videos 120, or up to twice as many.
TEST(BoardRecordings, LookAtFewFramesOfALongVideo) {
  EXPECT_EQ(looked_at(90, 30), 13);
  for (const int seconds : {30, 60, 600}) {
    EXPECT_LE(looked_at(30 * seconds, 30), 240);
    EXPECT_GE(looked_at(30 * seconds, 30), 120);
  }
}

}  // namespace
}  // namespace lapservo::internal
