#include "lapservo/calibration/recording/frame_recording.h"

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/calibration/recording/picture_light.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

class EvenFrames : public FrameSource {
 public:
  EvenFrames(const cv::Size& size, int count, int value = 10) : size_(size), count_(count), value_(value) {}
  std::optional<Frame> next() override {
    if (shown_ == count_) return std::nullopt;
    Frame frame;
    frame.bgr = cv::Mat(size_, CV_8UC3, cv::Scalar::all(value_ + shown_));
    frame.index = shown_++;
    return frame;
  }
  Kind kind() const override { return Kind::folder; }
  std::optional<int> frame_count() const override { return count_; }
  double frames_per_second() const override { return 30; }

 private:
  cv::Size size_;
  int count_, value_, shown_ = 0;
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

class FlawedSource : public EvenFrames {
 public:
  FlawedSource(const cv::Size& size, std::vector<Status> flaws, int value)
      : EvenFrames(size, static_cast<int>(flaws.size()), value), flaws_(std::move(flaws)) {}
  std::optional<Frame> next() override {
    auto frame = EvenFrames::next();
    if (frame && flaws_[static_cast<std::size_t>(frame->index)] != Status::ok)
      frame->flaw = flaws_[static_cast<std::size_t>(frame->index)];
    return frame;
  }

 private:
  std::vector<Status> flaws_;
};

TEST(FrameRecording, OfFlawedFramesAloneIsRefused) {
  const Rig rig = scenes::usual_rig();
  const auto said = [&](const std::vector<Status>& flaws, int value = 100) {
    FlawedSource source({rig.camera.width_px, rig.camera.height_px}, flaws, value);
    return testing::input_error([&] {
      read_frames({source, "frames"}, rig, 1, {}, [](const cv::Mat&, double) { return ""; });
    });
  };
  EXPECT_EQ(said({4, Status::damaged}),
            "frames: 4 of 4 frames are damaged: repair what carries them, or record them again");
  EXPECT_EQ(said({Status::few_colours, Status::damaged, Status::few_colours}),
            "frames: 2 of 3 frames have no more colours than a palette: record them in true colour, not indexed");
  EXPECT_EQ(said({Status::few_colours, Status::damaged, Status::few_colours}, 3),
            std::string("frames: ") + dark_pictures);
  EXPECT_EQ(said({Status::few_colours, Status::ok, Status::damaged}), "");
}

}  // namespace
}  // namespace lapservo::internal
