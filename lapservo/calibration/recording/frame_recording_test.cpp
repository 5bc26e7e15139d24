#include "lapservo/calibration/recording/frame_recording.h"

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/calibration/recording/test_frames.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::frame_recording_test {

// `check` looks at frames some frames later in another thread.
TEST(FrameRecording, FramesThatWereShownStayAsTheyAre) {
  const Rig rig = scenes::usual_rig();
  for (const bool deinterlace : {false, true}) {
    EvenFrames source({rig.camera.width_px, rig.camera.height_px}, 3);
    std::vector<cv::Mat> shown;
    read_frames({source, "frames", deinterlace}, rig, 1, {}, [&](const cv::Mat& bgr, double) {
      shown.push_back(bgr);
      return "";
    });
    ASSERT_EQ(shown.size(), 3U);
    for (std::size_t i = 0; i < shown.size(); ++i)
      EXPECT_EQ(cv::mean(shown[i])[0], 10.0 + static_cast<double>(i)) << deinterlace;
  }
}

struct ChangedFrames : EvenFrames {
  ChangedFrames(const Camera& camera, int count, std::function<void(Frame&)> how)
      : EvenFrames({camera.width_px, camera.height_px}, count), change(std::move(how)) {}
  std::optional<Frame> next() override {
    auto frame = EvenFrames::next();
    if (frame) change(*frame);
    return frame;
  }
  std::function<void(Frame&)> change;
};

std::string said_of(const Rig& rig, int count, bool deinterlace, const std::function<void(Frame&)>& change) {
  ChangedFrames source(rig.camera, count, change);
  const auto look = [](const cv::Mat&, double) { return ""; };
  return testing::input_error([&] { read_frames({source, "frames", deinterlace}, rig, 1, {}, look); });
}

TEST(FrameRecording, OfDamagedFramesAloneIsRefused) {
  const Rig rig = scenes::usual_rig();
  const std::optional damaged = Status::damaged;
  EXPECT_EQ(said_of(rig, 4, false, [&](Frame& f) { f.flaw = damaged; }),
            "frames: 4 of 4 frames are damaged: repair what carries them, or record them again");
  EXPECT_EQ(said_of(rig, 3, false, [&](Frame& f) { f.flaw = f.index == 1 ? std::nullopt : damaged; }), "");
}

TEST(FrameRecording, FramesThatWereReadOtherwiseThanTheyAreTrackedAreRefused) {
  Rig rig = scenes::usual_rig();
  for (const bool read : {false, true})
    for (const bool tracked : {false, true}) {
      const std::string said = said_of(rig, 1, tracked, [read](Frame& f) { f.deinterlaced = read; });
      EXPECT_EQ(said.substr(0, 25), read == tracked ? "" : "frames: deinterlaced: is ");
    }
  rig.camera.response = {.kind = Response::Kind::power, .gamma = 1.8};
  EXPECT_NE(said_of(rig, 1, false, [](Frame& f) { f.is_srgb = true; }).find("is read as sRGB"), std::string::npos);
}

}  // namespace lapservo::internal::frame_recording_test
