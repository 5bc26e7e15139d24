// board_video RIG OUT.mp4 [SECONDS]: a chessboard that a hand moves and tilts before the rig's camera, as video of 30
// frames a second. It moves at every sixth frame: what is rendered between would cost minutes.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numbers>

#include <Eigen/Geometry>

#include "lapservo/io/video_writer.h"
#include "lapservo/rig/rig.h"
#include "lapservo/testing/boards.h"

namespace {
using namespace lapservo;

constexpr int frames_per_second = 30, shown_frames = 6, seconds_between_poses = 2;

Rigid3 between(const Rigid3& a, const Rigid3& b, double fraction) {
  return {a.rotation.slerp(fraction, b.rotation), (1 - fraction) * a.translation + fraction * b.translation};
}

void write(const Camera& camera, const char* path, int seconds) {
  const boards::BoardScene scene;
  const auto poses = boards::different_poses(scene, camera, seconds / seconds_between_poses + 2, 1);
  internal::VideoWriter video(path, frames_per_second);
  for (int i = 0; i < seconds * frames_per_second / shown_frames; ++i) {
    const double at = static_cast<double>(i * shown_frames) / (frames_per_second * seconds_between_poses);
    const auto from = static_cast<std::size_t>(at);
    const double fraction = 0.5 - 0.5 * std::cos(std::numbers::pi * (at - static_cast<double>(from)));
    const cv::Mat frame =
        boards::render(scene, camera, between(poses[from], poses[from + 1], fraction), static_cast<std::uint64_t>(i));
    for (int k = 0; k < shown_frames; ++k) video.add(frame);
  }
  video.commit();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return std::fputs("board_video RIG OUT.mp4 [SECONDS]\n", stderr), 2;
  try {
    write(load_rig(argv[1]).camera, argv[2], argc > 3 ? std::atoi(argv[3]) : 60);
  } catch (const std::exception& e) {
    return std::fprintf(stderr, "%s\n", e.what()), 2;
  }
}
