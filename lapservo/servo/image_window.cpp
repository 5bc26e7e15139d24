#include "lapservo/servo/image_window.h"

#include <algorithm>
#include <string>

#include "lapservo/core/error.h"

namespace lapservo {

ImageWindow image_window(const Camera& camera, double margin_px) {
  constexpr int steps = 64;
  const double right = camera.width_px - 1 - margin_px, bottom = camera.height_px - 1 - margin_px;
  const auto ideal = [&](double u, double v) {
    const auto px = camera.ideal_from_raw({u, v});
    if (!px) throw InputError("controller", "margin_px", std::to_string(margin_px), "a margin inside the image");
    return *px;
  };
  ImageWindow window{-1e9, 1e9, -1e9, 1e9};
  for (int i = 0; i <= steps; ++i) {
    const double u = margin_px + (right - margin_px) * i / steps, v = margin_px + (bottom - margin_px) * i / steps;
    window.u_min_px = std::max(window.u_min_px, ideal(margin_px, v).x());
    window.u_max_px = std::min(window.u_max_px, ideal(right, v).x());
    window.v_min_px = std::max(window.v_min_px, ideal(u, margin_px).y());
    window.v_max_px = std::min(window.v_max_px, ideal(u, bottom).y());
  }
  if (!(window.u_max_px > window.u_min_px && window.v_max_px > window.v_min_px))
    throw InputError("controller", "margin_px", std::to_string(margin_px), "a margin that leaves some of the image");
  return window;
}

}  // namespace lapservo
