#include "lapservo/calibration/camera/camera_measurement.h"

#include <optional>

#include <gtest/gtest.h>

#include "lapservo/calibration/recording/test_frames.h"

namespace lapservo::internal {
namespace {

int looked_at(int frames, double fps) {
  BoardRecordings recordings({.columns = 9, .rows = 6}, 30, std::nullopt);
  EvenFrames video({64, 48}, frames, fps);
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
