#include "cameras/camera.h"

#include <gtest/gtest.h>

namespace lapservo::internal::camera_test {

TEST(Camera, HasAName) {
  for (const char* camera : {"0", "12", "/dev/video0", "/dev/video12", "gst:videotestsrc", "gst:"})
    EXPECT_TRUE(names_camera(camera)) << camera;
  for (const char* other : {"", "1234", "0.png", "video0", "ros2:/image", "rtsp://camera/1", "/dev/null", "v4l2src"})
    EXPECT_FALSE(names_camera(other)) << other;
}

TEST(Camera, ADeviceIsAPipelineAndAPipelineItself) {
  EXPECT_EQ(camera_pipeline("gst:videotestsrc ! identity", {640, 480}), "videotestsrc ! identity");
  const std::string any =
      "v4l2src device=\"/dev/video2\" ! capsfilter "
      "caps=\"video/x-raw,framerate=[25/1,1000/1];image/jpeg;video/x-raw\" ! decodebin";
  EXPECT_EQ(camera_pipeline("2", {}), any);
  EXPECT_EQ(camera_pipeline("/dev/video2", {}), any);
  EXPECT_EQ(camera_pipeline("/dev/video2", {640, 480}),
            "v4l2src device=\"/dev/video2\" ! capsfilter "
            "caps=\"video/x-raw,width=640,height=480,framerate=[25/1,1000/1];image/jpeg,width=640,height=480;"
            "video/x-raw,width=640,height=480\" ! decodebin");
  EXPECT_EQ(camera_pipeline("/dev/video\" ! fakesink", {}).find("v4l2src device=\"/dev/video\\\" ! fakesink\" ! "), 0u);
}

}  // namespace lapservo::internal::camera_test
