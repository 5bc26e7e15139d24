#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"

namespace lapservo::internal {

/// Where an edge of the board was seen in one channel: the line through raw_px across `normal`.
struct EdgePoint {
  Eigen::Vector3d point_m;  ///< on the board
  Eigen::Vector2d raw_px, normal;
  double sigma_px;
  int towards_bright;  ///< 1 where `normal` points to the brighter square, else -1
  int channel;         ///< 0 blue, 1 green, 2 red
};

/// The free parameters of the camera; otherwise k3 is 0, and fy is fx.
struct CameraFreedom {
  bool k3 = true, aspect = true;
  bool faults = true;  ///< to be looked for
};

/// A fault that the model of one camera and one flat board leaves out.
struct CameraFault {
  enum class Kind { zoom, centre, rolling_shutter, bent_board, stretched_board } kind;
  std::size_t view = 0;  ///< of the first three, which may be there in one view
  double size = 0;       ///< relative, px, px over the image's height, the sag in m, relative
};

struct CameraAdjustment {
  Camera camera;                                  ///< with its sigmas and covariance
  double sigma_aspect = 0;                        ///< of fy / fx
  std::vector<Rigid3> camera_from_board;          ///< as many as views
  std::vector<std::vector<double>> residuals_px;  ///< of each point: found minus expected, along `normal`
  std::array<double, 3> bright_wider_px{};        ///< by channel: how far edges lie towards dark squares, mean of views
  double noise = 1;                               ///< how many times the points' own sigmas the residuals are; robust
  std::vector<CameraFault> faults;                ///< that show, the clearest first: the sigmas count them
};

/// A number of a camera, and its standard deviation.
struct CameraNumber {
  const char* name;
  double &value, &sigma;
};
std::array<CameraNumber, 11> numbers_of(Camera& camera);

/// Fits a camera and the poses of a board in all views to the points of its edges (Ceres, Cauchy loss). Bright squares
/// that look wider than dark ones, by as much all over a view, are allowed for. nullopt when it does not settle.
std::optional<CameraAdjustment> adjust_camera(const Camera& start, const std::vector<Rigid3>& camera_from_board,
                                              const std::vector<std::vector<EdgePoint>>& views,
                                              const CameraFreedom& freedom, const AtIteration& at_iteration);

}  // namespace lapservo::internal
