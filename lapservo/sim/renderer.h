#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/sim/scene.h"

namespace lapservo {

struct RenderOptions {
  Lighting lighting;
  Sensor sensor;
  float smoke = 0;  ///< fraction of grey veil in front of everything, 0 to 1
};

/// The scene of one exposure: the shafts at one or, for motion blur, several moments of it.
using Exposure = std::vector<std::vector<ShaftPlacement>>;

/// Renders shafts with markers, and their tools, in front of a background, from physical geometry: rays against
/// cylinders, area-sampled at every edge, shaded and blurred in linear light, then the sensor. Never through the vision
/// code or the cross-ratio. Positions of edges are right to 0.01 px. The background is blurred and encoded once; a
/// frame costs its shafts and the noise.
class Renderer {
 public:
  /// `background`: linear light, CV_32FC3, of the camera's size.
  Renderer(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background, RenderOptions options = {});
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// One placement per shaft. The same seed gives the same noise.
  cv::Mat render(const std::vector<ShaftPlacement>& placements, std::uint64_t seed);
  cv::Mat render_exposure(const Exposure& exposure, std::uint64_t seed);

  /// Exposure and white balance of the frames to come; a change costs about a frame.
  void set_gains(const Light& gains);
  /// One that shares nothing with this, for another thread.
  Renderer clone() const;

 private:
  class State;
  explicit Renderer(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace lapservo
