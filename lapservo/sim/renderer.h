#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/optics.h"
#include "lapservo/sim/outline.h"
#include "lapservo/sim/scene.h"
#include "lapservo/sim/sensor.h"
#include "lapservo/sim/shaft_painter.h"

namespace lapservo {

struct RenderOptions {
  Lighting lighting;
  Sensor sensor;
  float smoke = 0;  ///< share of grey veil in front of everything, 0 to 1
};

/// What one exposure sees: the shafts at one or, for motion blur, several moments of it.
using Exposure = std::vector<std::vector<ShaftPlacement>>;

/// Renders shafts with markers in front of a background, from physical geometry: rays against cylinders, area-sampled
/// at every edge, shaded and blurred in linear light, then the sensor. Never through the vision code or the
/// cross-ratio. Positions of edges are right to 0.01 px.
/// The background is blurred and encoded once; a frame costs its shafts and the noise.
class Renderer {
 public:
  /// `background`: linear light, CV_32FC3, of the camera's size.
  Renderer(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background, RenderOptions options = {});
  Renderer(Renderer&&) = default;
  Renderer& operator=(Renderer&&) = default;

  /// One placement per shaft. The same seed gives the same noise.
  cv::Mat render(const std::vector<ShaftPlacement>& placements, std::uint64_t seed);
  cv::Mat render_exposure(const Exposure& exposure, std::uint64_t seed);

  /// Exposure and white balance of the frames to come; a change costs about a frame.
  void set_gains(const Light& gains);
  /// One that shares nothing with this, for another thread.
  Renderer clone() const { return Renderer(camera_, shafts_, background_light_, options_); }

 private:
  void develop_background();
  std::vector<cv::Rect> draw(const std::vector<ShaftPlacement>& placements);
  void clear(const std::vector<cv::Rect>& drawn);
  void develop(const cv::Mat& light, const cv::Rect& part, SensorEncoder::Encoded& encoded);

  Camera camera_;
  double half_field_rad_;
  std::vector<ShaftModel> shafts_;
  RenderOptions options_;
  Optics optics_;
  SensorEncoder encoder_;
  PixelRays rays_;
  Canvas canvas_;                              // the frame being drawn
  cv::Mat background_light_;                   // sharp
  SensorEncoder::Encoded background_, frame_;  // blurred and encoded
  std::vector<float> veiled_;
};

}  // namespace lapservo
