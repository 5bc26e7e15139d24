#include "lapservo/io/video/read_ahead.h"

#include <atomic>
#include <stdexcept>

#include <gtest/gtest.h>

namespace lapservo::internal::read_ahead_test {

// So many frames of one pixel, then the end or an exception; counts the requests.
class Counted : public FrameSource {
 public:
  Counted(int count, bool throws, std::atomic<int>& read) : count_(count), throws_(throws), read_(read) {}
  std::optional<Frame> next() override {
    if (read_ == count_ && throws_) throw std::runtime_error("broken");
    if (read_ == count_) return std::nullopt;
    Frame frame;
    frame.index = read_++;
    frame.time_s = 0.1 * frame.index;
    frame.bgr = cv::Mat(1, 1, CV_8UC3, cv::Scalar::all(frame.index));
    return frame;
  }
  Kind kind() const override { return Kind::video; }
  std::optional<int> frame_count() const override { return count_; }
  double frames_per_second() const override { return 10; }
  std::optional<double> first_stamp_s() const override { return 7; }
  std::string complaint() const override { return read_ == count_ ? "it ends" : "not yet"; }

 private:
  int count_;
  bool throws_;
  std::atomic<int>& read_;
};

TEST(ReadAhead, GivesTheSameFramesInTheirOrderAndTheEndAgainAndAgain) {
  for (const int count : {0, 1, 2, 50}) {
    std::atomic<int> read = 0;
    const auto source = read_ahead(std::make_unique<Counted>(count, false, read));
    EXPECT_EQ(source->frame_count(), count);
    EXPECT_EQ(source->frames_per_second(), 10);
    EXPECT_EQ(source->first_stamp_s(), 7);
    EXPECT_EQ(source->kind(), FrameSource::Kind::video);
    EXPECT_EQ(read, 0);  // no request yet
    for (int i = 0; i < count; ++i) {
      const auto frame = source->next();
      ASSERT_TRUE(frame);
      EXPECT_EQ(frame->index, i);
      EXPECT_EQ(frame->time_s, 0.1 * i);
      EXPECT_EQ(frame->bgr.at<cv::Vec3b>(0, 0)[0], i);
    }
    EXPECT_FALSE(source->next());
    EXPECT_FALSE(source->next());
    EXPECT_EQ(source->complaint(), "it ends");
    EXPECT_FALSE(source->next());
  }
}

TEST(ReadAhead, ThrowsWhatTheSourceThrowsAfterTheFramesBeforeIt) {
  std::atomic<int> read = 0;
  const auto source = read_ahead(std::make_unique<Counted>(5, true, read));
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(source->next());
  EXPECT_THROW(source->next(), std::runtime_error);
  EXPECT_FALSE(source->next());
}

TEST(ReadAhead, IsAFewFramesAheadAtMostAndMayBeLeftAtAnyTime) {
  for (const int taken : {0, 1, 7}) {
    std::atomic<int> read = 0;
    {
      const auto source = read_ahead(std::make_unique<Counted>(1000, false, read));
      for (int i = 0; i < taken; ++i) ASSERT_TRUE(source->next());
    }
    EXPECT_LE(read, taken + 4);
    read = 0;
    const auto source = read_ahead(std::make_unique<Counted>(1000, false, read));
    for (int i = 0; i < taken; ++i) ASSERT_TRUE(source->next());
    EXPECT_EQ(source->complaint(), "not yet");
  }
}

}  // namespace lapservo::internal::read_ahead_test
