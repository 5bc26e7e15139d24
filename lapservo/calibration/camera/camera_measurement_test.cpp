#include "lapservo/calibration/camera/camera_measurement.h"

#include <optional>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/calibration/recording/test_frames.h"
#include "lapservo/sim/boards.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::camera_measurement_test {

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

// One frame.
class OneFrame : public EvenFrames {
 public:
  explicit OneFrame(cv::Mat bgr) : EvenFrames(bgr.size(), 1), bgr_(std::move(bgr)) {}
  std::optional<Frame> next() override {
    auto frame = EvenFrames::next();
    if (frame) frame->bgr = bgr_;
    return frame;
  }

 private:
  cv::Mat bgr_;
};

// By the rig's key or by the option; the odd rows are of another moment.
TEST(BoardRecordings, LookAtTheEvenFieldOfInterlacedImages) {
  const BoardScene scene;
  Rig rig = testing::small_test_rig();
  const Rigid3 pose = board_poses(scene, rig.camera, 1, 1).front();
  cv::Mat woven = render_board(scene, rig.camera, pose, 1);
  const cv::Mat expected = EvenField(rig.camera.response).of(woven).clone();
  for (int y = 1; y < woven.rows; y += 2) woven.row(y).setTo(cv::Scalar::all(128));
  for (const bool by_key : {false, true}) {
    rig.camera.deinterlace = by_key;
    BoardRecordings recordings({9, 6, scene.square_m}, 30, rig, !by_key);
    OneFrame video(woven);
    recordings.look_at(video, "video", {});
    const auto views = recordings.take_views();
    ASSERT_EQ(views.size(), 1U);
    EXPECT_EQ(cv::norm(views[0].bgr, expected, cv::NORM_INF), 0);
  }
}

// Squares are counted, or a row too many.
TEST(MeasureCamera, NamesTheBoardThatIsSeen) {
  const BoardScene scene;
  const Camera camera = testing::small_test_rig().camera;
  OneFrame video(render_board(scene, camera, board_poses(scene, camera, 1, 1).front(), 1));
  BoardRecordings recordings({scene.columns + 1, scene.rows + 1, scene.square_m}, 30, std::nullopt);
  recordings.look_at(video, "video", {});
  const std::string refusal = measure_camera({}, std::move(recordings), camera, {}).refusal;
  EXPECT_NE(refusal.find("--board 9x6"), std::string::npos) << refusal;
}

}  // namespace lapservo::internal::camera_measurement_test
