#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"

namespace lapservo::internal {

/// A chessboard on white paper before a camera under a lamp: what the light is, what the camera makes of it.
struct BoardScene {
  int columns = 9, rows = 6;  ///< inner corners
  double square_m = 0.005;
  double bright = 0.8, dark = 0.04;  ///< reflectances
  double exposure = 0.9;             ///< light of a white board where the lamp is brightest
  double falloff = 2;                ///< of the lamp: its light over that at the image's width beyond, less 1; 0: even
  double blur_px = 0.8;
  double noise = 0.006;  ///< of white's light; half of it in the dark
  double sharpening = 0, sharpening_px = 1.5;
};

/// 8-bit BGR. The camera's response, distortion and chromatic aberration count.
cv::Mat render_board(const BoardScene& scene, const Camera& camera, const Rigid3& camera_from_board,
                     std::uint64_t seed);

/// Poses that fill the image, tilted by 15 to 35 degrees.
std::vector<Rigid3> board_poses(const BoardScene& scene, const Camera& camera, int count, std::uint64_t seed);

}  // namespace lapservo::internal
