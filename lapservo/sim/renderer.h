#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/scene.h"
#include "lapservo/sim/sensor.h"
#include "lapservo/sim/shaft_caster.h"

namespace lapservo {

struct RenderOptions {
  Lighting lighting;
  Sensor sensor;
  float smoke = 0;  ///< share of grey veil in front of everything, 0 to 1
};

/// What one exposure sees: the shafts at one or, for motion blur, several moments of it.
using Exposure = std::vector<std::vector<ShaftPlacement>>;

/// Renders shafts with markers in front of a background, from physical geometry: rays against cylinders, area-sampled
/// at every edge (32 rays a pixel), shaded and blurred in linear light, then the sensor. Never through the vision code
/// or the cross-ratio. Positions of edges are right to 0.02 px.
class Renderer {
 public:
  /// `background`: linear light, CV_32FC3, of the camera's size.
  Renderer(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background, RenderOptions options = {});

  /// One placement per shaft. The same seed gives the same noise.
  cv::Mat render(const std::vector<ShaftPlacement>& placements, std::uint64_t seed);
  cv::Mat render_exposure(const Exposure& exposure, std::uint64_t seed);

 private:
  void draw(const std::vector<ShaftPlacement>& placements, float share, std::vector<cv::Rect>& tiles);
  void draw_tile(const std::vector<ShaftCaster>& casters, const cv::Rect& tile, float share);
  Eigen::Vector3d ray(double u, double v) const;

  Camera camera_;
  std::vector<ShaftModel> shafts_;
  RenderOptions options_;
  SensorEncoder encoder_;
  cv::Mat sharp_, light_, rays_;  // background; the frame being drawn; ideal rays when distorted
  SensorEncoder::Encoded background_, frame_;
};

}  // namespace lapservo
