#include "lapservo/calibration/recording/frame_recording.h"

#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

class EvenFrames : public FrameSource {
 public:
  EvenFrames(const cv::Size& size, int count) : size_(size), count_(count) {}
  std::optional<Frame> next() override {
    if (shown_ == count_) return std::nullopt;
    Frame frame;
    frame.bgr = cv::Mat(size_, CV_8UC3, cv::Scalar::all(10 + shown_));
    frame.index = shown_++;
    return frame;
  }
  Kind kind() const override { return Kind::folder; }
  std::optional<int> frame_count() const override { return count_; }
  double frames_per_second() const override { return 30; }

 private:
  cv::Size size_;
  int count_, shown_ = 0;
};

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

}  // namespace
}  // namespace lapservo::internal
