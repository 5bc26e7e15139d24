#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "cameras/camera.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/crtk/image_receiver.h"
#include "lapservo/crtk/test_inbox.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal {
namespace {

bool wait_for(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  return condition();
}

TEST(GstCamera, ImagesCarryTheMonotonicTimeOfTheirCapture) {
  TestInbox<ImageMessage> images;
  const SteadyClock clock;
  std::mutex mutex;
  std::vector<double> ages_s;
  const auto take = images.handler();
  const auto camera = open_gst_camera(
      "videotestsrc is-live=true pattern=red ! video/x-raw,format=I420,width=322,height=200,framerate=100/1",
      {[&](ImageMessage&& message) {
         const std::lock_guard lock(mutex);
         ages_s.push_back(clock.now_s() - message.stamp_s);
         take(std::move(message));
       },
       {}});
  ASSERT_TRUE(wait_for([&] { return images.count() >= 20; }));
  EXPECT_FALSE(camera->ended());
  const auto all = images.all();
  for (std::size_t i = 1; i < all.size(); ++i) EXPECT_GT(all[i].stamp_s, all[i - 1].stamp_s);
  EXPECT_EQ(all[0].width, 322u);
  EXPECT_EQ(all[0].height, 200u);
  const DecodedImage decoded = decode(all[0]);  // rows of 966 bytes, padded to 968
  ASSERT_TRUE(std::holds_alternative<cv::Mat>(decoded));
  const auto pixel = std::get<cv::Mat>(decoded).at<cv::Vec3b>(199, 321);
  EXPECT_LT(pixel[0], 20);
  EXPECT_GT(pixel[2], 230);
  const std::lock_guard lock(mutex);
  for (const double age_s : ages_s) {
    EXPECT_GT(age_s, -0.02);
    EXPECT_LT(age_s, 5);  // however busy this computer is
  }
}

TEST(GstCamera, AFileOrAnEndIsPlayedAtItsOwnSpeedAndSaid) {
  TestInbox<ImageMessage> images;
  const auto begin = std::chrono::steady_clock::now();
  const auto camera = open_gst_camera("videotestsrc num-buffers=11 ! video/x-raw,width=64,height=48,framerate=20/1",
                                      {images.handler(), {}});
  ASSERT_TRUE(wait_for([&] { return camera->ended().has_value(); }));
  EXPECT_EQ(camera->ended(), "");
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(450));
}

TEST(GstCamera, RepeatedAndResizedFramesAreCounted) {
  const SteadyClock clock;
  ImageReceiver receiver(64, 48);
  // Each frame twice, with one stamp.
  const auto camera =
      open_gst_camera("videotestsrc is-live=true num-buffers=10 ! video/x-raw,width=32,height=48,framerate=50/1",
                      {[&](ImageMessage&& message) {
                         receiver.receive(ImageMessage(message), clock.now_s());
                         receiver.newest();
                         receiver.receive(std::move(message), clock.now_s());
                       },
                       {}});
  ASSERT_TRUE(wait_for([&] { return camera->ended().has_value(); }));
  EXPECT_GT(receiver.counts().resized, 0);
  EXPECT_EQ(receiver.counts().repeated, receiver.counts().resized);
  EXPECT_EQ(receiver.complaint(), "the same stamp again");
}

TEST(GstCamera, ABadPipelineIsRefusedInOneLine) {
  const auto refusal = [](const char* pipeline) {
    return testing::input_error([&] { open_gst_camera(pipeline, {[](ImageMessage&&) {}, {}}); });
  };
  EXPECT_NE(refusal("nosuchelement").find("gst:nosuchelement: can't be played (no element \"nosuchelement\""),
            std::string::npos)
      << refusal("nosuchelement");
  EXPECT_NE(refusal("filesrc location=/nowhere ! decodebin").find("can't be played (filesrc"), std::string::npos)
      << refusal("filesrc location=/nowhere ! decodebin");
  for (const char* bad : {"", "!", "videotestsrc ! fakesink", "audiotestsrc", "videotestsrc pattern=nosuch"}) {
    const std::string said = refusal(bad);
    EXPECT_NE(said, "") << bad;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
}

// An error while it plays: a source that breaks off.
TEST(GstCamera, AnErrorLaterIsSaid) {
  const auto camera = open_gst_camera(
      "videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=50/1 ! identity error-after=5",
      {[](ImageMessage&&) {}, {}});
  ASSERT_TRUE(wait_for([&] { return camera->ended().has_value(); }));
  EXPECT_NE(camera->ended()->find("identity"), std::string::npos) << *camera->ended();
}

}  // namespace
}  // namespace lapservo::internal
