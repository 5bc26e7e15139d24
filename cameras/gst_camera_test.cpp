#include <algorithm>
#include <chrono>
#include <gst/gst.h>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "cameras/camera.h"
#include "lapservo/crtk/image_decoder.h"
#include "lapservo/crtk/test_inbox.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::gst_camera_test {
using testing::wait_for;

TEST(GstCamera, ImagesCarryTheMonotonicTimeOfTheirCapture) {
  TestInbox<ImageMessage> images;
  const SteadyClock clock;
  std::mutex mutex;
  std::vector<double> ages_s;
  const auto take = images.handler();
  const auto camera = open_camera(
      "gst:videotestsrc is-live=true pattern=red ! video/x-raw,format=I420,width=322,height=200,framerate=100/1", {},
      [&](ImageMessage&& message) {
        const std::lock_guard lock(mutex);
        ages_s.push_back(clock.now_s() - message.stamp_s);
        take(std::move(message));
      });
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
  const auto camera = open_camera("gst:videotestsrc num-buffers=11 ! video/x-raw,width=64,height=48,framerate=20/1", {},
                                  images.handler());
  ASSERT_TRUE(wait_for([&] { return camera->ended().has_value(); }));
  EXPECT_EQ(camera->ended(), "");
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(450));
}

// As cameras send it: without the Huffman tables that JPEG's standard names.
std::string motion_jpeg(const cv::Size& size, const cv::Scalar& bgr) {
  std::vector<std::uint8_t> jpeg = encode_jpeg(cv::Mat(size, CV_8UC3, bgr));
  for (std::size_t at = 2; jpeg[at + 1] != 0xda;) {
    const std::size_t length = 2 + 256u * jpeg[at + 2] + jpeg[at + 3];
    if (jpeg[at + 1] == 0xc4) {
      jpeg.erase(jpeg.begin() + static_cast<std::ptrdiff_t>(at),
                 jpeg.begin() + static_cast<std::ptrdiff_t>(at + length));
    } else {
      at += length;
    }
  }
  return {jpeg.begin(), jpeg.end()};
}

// Whatever a device sends, by another source in its place.
TEST(GstCamera, ADevicesRawAndJpegImagesHaveTheirColours) {
  const testing::TemporaryFolder folder;
  const std::string device = "v4l2src device=\"/dev/video0\"", raw = "videotestsrc is-live=true pattern=red";
  for (const cv::Size& size : {cv::Size(640, 480), cv::Size(1280, 720)}) {
    testing::write_file(folder / "jpeg", motion_jpeg(size, {0, 0, 255}));
    const std::string jpeg =
        "filesrc location=" + (folder / "jpeg").string() +
        " blocksize=1000000 ! queue ! capsfilter caps=image/jpeg,framerate=25/1,width=" + std::to_string(size.width) +
        ",height=" + std::to_string(size.height);
    std::string pipeline = camera_pipeline("/dev/video0", size);
    ASSERT_TRUE(pipeline.starts_with(device));
    pipeline.erase(0, device.size());
    for (const std::string& source : {raw, raw + " ! video/x-raw,format=YUY2", jpeg}) {
      const auto frame = open_camera_or_file("gst:" + source + pipeline, 30)->next();
      ASSERT_TRUE(frame) << source;
      EXPECT_EQ(frame->bgr.size(), size) << source;
      const auto pixel = frame->bgr.at<cv::Vec3b>(100, 100);
      EXPECT_LE(std::max(pixel[0], pixel[1]), 3) << source << pixel;
      EXPECT_GE(pixel[2], 252) << source << pixel;
    }
  }
}

TEST(GstCamera, WhatGivesNoImagesIsRefusedInOneLine) {
  struct Refusal {
    std::string camera;
    std::vector<std::string> said{"expected a pipeline"};
    cv::Size size{};
  };
  for (const Refusal& one :
       {Refusal{"gst:nosuchelement",
                {"gst:nosuchelement: gives no images (no element \"nosuchelement\"", "plugins-good"}},
        Refusal{"gst:filesrc location=/nowhere ! decodebin", {"(filesrc", "No such file", "expected a pipeline"}},
        Refusal{"gst:videotestsrc ! video/x-raw,format=nosuch"}, Refusal{"gst:"}, Refusal{"gst:!"},
        Refusal{"gst:videotestsrc ! fakesink"}, Refusal{"gst:audiotestsrc"}, Refusal{"gst:videotestsrc pattern=nosuch"},
        Refusal{"/dev/video-none",
                {"/dev/video-none: gives no images (v4l2src", "No such file", "plugged in", "group video"}},
        Refusal{"/dev/video-none", {"and that gives 640x480 as in the rig"}, {640, 480}},
        Refusal{"/dev/video/../null", {"expected a camera"}}}) {
    const std::string refusal = testing::input_error([&] { open_camera(one.camera, one.size); });
    for (const std::string& part : one.said)
      EXPECT_NE(refusal.find(part), std::string::npos) << one.camera << ": " << refusal;
    EXPECT_EQ(refusal.find('\n'), std::string::npos) << refusal;
  }
}

// A source that fails at once, and says why 0.2 s later in another thread.
std::thread late_reason;
GstStateChangeReturn fail(GstElement* element, GstStateChange change) {
  if (change != GST_STATE_CHANGE_NULL_TO_READY) return GST_STATE_CHANGE_SUCCESS;
  gst_object_ref(element);
  late_reason = std::thread([element] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    GST_ELEMENT_ERROR(element, RESOURCE, BUSY, ("another program uses it"), (nullptr));
    gst_object_unref(element);
  });
  return GST_STATE_CHANGE_FAILURE;
}

TEST(GstCamera, TheReasonOfAFailureIsWaitedFor) {
  ASSERT_TRUE(gst_init_check(nullptr, nullptr, nullptr));
  GstElement* const usual = gst_element_factory_make("videotestsrc", nullptr);
  GTypeQuery type;
  g_type_query(G_OBJECT_TYPE(usual), &type);
  const auto change = [](gpointer made, gpointer) { GST_ELEMENT_CLASS(made)->change_state = fail; };
  const GType late = g_type_register_static_simple(type.type, "LapservoLate", type.class_size, change,
                                                   type.instance_size, nullptr, GTypeFlags(0));
  ASSERT_TRUE(gst_element_register(nullptr, "lapservolate", GST_RANK_NONE, late));
  gst_object_unref(usual);
  const std::string refusal = testing::input_error([] { open_camera("gst:lapservolate", {}); });
  late_reason.join();
  EXPECT_NE(refusal.find("another program uses it"), std::string::npos) << refusal;
}

TEST(CameraFrames, AreAllOfAFileAndEndWithIt) {
  const auto frames =
      open_camera_or_file("gst:videotestsrc num-buffers=9 ! video/x-raw,width=64,height=48,framerate=50/1", 30);
  EXPECT_EQ(frames->kind(), FrameSource::Kind::live);
  EXPECT_EQ(frames->frames_per_second(), 50);
  for (int i = 0; i < 9; ++i) {
    const auto frame = frames->next();
    ASSERT_TRUE(frame) << i;
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(frame->bgr.size(), cv::Size(64, 48));
    EXPECT_NEAR(frame->time_s, i / 50.0, 1e-6);
    std::this_thread::sleep_for(std::chrono::milliseconds(60));
  }
  EXPECT_FALSE(frames->next());
  EXPECT_EQ(frames->complaint(), "");
}

// Whoever is slow gets the newest, and not those that have been waiting.
TEST(CameraFrames, OfALiveCameraAreTheNewest) {
  const auto frames =
      open_camera_or_file("gst:videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=100/1", 30);
  const auto first = frames->next();
  std::this_thread::sleep_for(std::chrono::seconds(1));
  const auto second = frames->next();
  ASSERT_TRUE(first && second);
  EXPECT_GT(second->time_s - first->time_s, 0.5);
}

TEST(CameraFrames, EndWhenTheyAreToStopOrTheCameraFails) {
  const std::string camera = "gst:videotestsrc is-live=true ! video/x-raw,width=64,height=48,framerate=50/1";
  EXPECT_FALSE(open_camera_or_file(camera, 30, {}, [] { return true; })->next());
  const auto frames = open_camera_or_file(camera + " ! identity error-after=5", 30);
  while (frames->next())
    ;
  EXPECT_NE(frames->complaint().find("identity"), std::string::npos) << frames->complaint();
}

}  // namespace lapservo::internal::gst_camera_test
