#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "lapservo/sim/outline.h"
#include "lapservo/sim/scene.h"
#include "lapservo/sim/shaft_painter.h"

namespace lapservo::internal {

/// The tool's links in the camera's frame, from the shaft's end to the tip, where they end; of a wrist the last two are
/// the fingers of a closed jaw. None without a tool in its place. Throws as tip_in_marker does.
std::vector<Capsule> tool_links(const ShaftModel& model, const ShaftPlacement& placement);

/// Paints links of bare metal.
class ToolPainter {
 public:
  ToolPainter(std::vector<Capsule> links, const Lighting& lighting);

  /// Paints pixels of `part` before and behind what the scene holds; `behind` is the background alone.
  void paint(const PixelRays& rays, const cv::Rect& part, const cv::Mat& behind, SceneLight& scene) const;

 private:
  struct Hit {
    int link = -1;  ///< none
    float depth_m = 0;
  };
  Hit trace(float x, float y) const;
  Light light_from(const Hit& hit, float x, float y) const;
  /// A pixel by its corners (0,0), (1,0), (1,1), (0,1), and how near its nearest part is.
  Paint paint_pixel(const std::array<Hit, 4>& hits, const std::array<float, 4>& x, const std::array<float, 4>& y,
                    float& depth_m) const;

  std::vector<Capsule> links_;
  Lighting lighting_;
  std::array<Eigen::Vector3f, 2> lamps_;
};

}  // namespace lapservo::internal
