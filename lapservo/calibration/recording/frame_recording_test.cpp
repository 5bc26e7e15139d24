#include "lapservo/calibration/recording/frame_recording.h"

#include <optional>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/calibration/recording/test_frames.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

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
      EXPECT_EQ(cv::mean(shown[i]),
                cv::Scalar(10.0 + static_cast<double>(i), 10.0 + static_cast<double>(i), 10.0 + static_cast<double>(i)))
          << deinterlace;
  }
}

class DamagedSource : public EvenFrames {
 public:
  DamagedSource(const cv::Size& size, std::vector<bool> damaged)
      : EvenFrames(size, static_cast<int>(damaged.size())), damaged_(std::move(damaged)) {}
  std::optional<Frame> next() override {
    auto frame = EvenFrames::next();
    if (frame && damaged_[static_cast<std::size_t>(frame->index)]) frame->flaw = Status::damaged;
    return frame;
  }

 private:
  std::vector<bool> damaged_;
};

TEST(FrameRecording, OfDamagedFramesAloneIsRefused) {
  const Rig rig = scenes::usual_rig();
  const auto said = [&](const std::vector<bool>& damaged) {
    DamagedSource source({rig.camera.width_px, rig.camera.height_px}, damaged);
    return testing::input_error([&] {
      read_frames({source, "frames"}, rig, 1, {}, [](const cv::Mat&, double) { return ""; });
    });
  };
  EXPECT_EQ(said(std::vector(4, true)),
            "frames: 4 of 4 frames are damaged: repair what carries them, or record them again");
  EXPECT_EQ(said({true, false, true}), "");
}

}  // namespace
}  // namespace lapservo::internal
