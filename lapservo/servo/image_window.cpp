#include "lapservo/servo/image_window.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "lapservo/core/error.h"
#include "lapservo/geometry/field_of_view.h"

namespace lapservo {

namespace {

// A square of rays that holds all that the distortion does not fold.
ImageWindow unfolded(const Camera& camera) {
  const double farthest = std::tan(internal::half_field_rad(camera));
  const double u_px = farthest * camera.fx_px, v_px = farthest * camera.fy_px;
  return {camera.cx_px - u_px, camera.cx_px + u_px, camera.cy_px - v_px, camera.cy_px + v_px};
}

// Shrinks it until its corners lie where the distortion does not fold.
void leave_out_fold(const Camera& camera, ImageWindow& window) {
  double farthest = 0;
  for (const double u : {window.u_min_px, window.u_max_px})
    for (const double v : {window.v_min_px, window.v_max_px})
      farthest = std::max(farthest, camera.ray_from_ideal({u, v}).head<2>().norm());
  const double part = std::min(1.0, std::tan(internal::half_field_rad(camera)) / farthest);
  for (double* u : {&window.u_min_px, &window.u_max_px}) *u = camera.cx_px + part * (*u - camera.cx_px);
  for (double* v : {&window.v_min_px, &window.v_max_px}) *v = camera.cy_px + part * (*v - camera.cy_px);
}

}  // namespace

ImageWindow image_window(const Camera& camera, double margin_px) {
  constexpr int steps = 64;
  const auto expect = [&](bool leaves_some) {
    if (!leaves_some)
      throw InputError("controller", "margin_px", std::to_string(margin_px), "a margin that leaves some of the image");
  };
  expect(margin_px >= 0 && 2 * margin_px < std::min(camera.width_px, camera.height_px));  // else NaN passes by min, max
  const double right = camera.width_px - 1 - margin_px, bottom = camera.height_px - 1 - margin_px;
  const auto narrow = [&](double& bound, double u, double v, int axis, bool is_low) {
    if (const auto px = camera.ideal_from_raw({u, v}))
      bound = is_low ? std::max(bound, (*px)[axis]) : std::min(bound, (*px)[axis]);
  };
  ImageWindow window = unfolded(camera);
  for (int i = 0; i <= steps; ++i) {
    const double u = margin_px + (right - margin_px) * i / steps, v = margin_px + (bottom - margin_px) * i / steps;
    narrow(window.u_min_px, margin_px, v, 0, true);
    narrow(window.u_max_px, right, v, 0, false);
    narrow(window.v_min_px, u, margin_px, 1, true);
    narrow(window.v_max_px, u, bottom, 1, false);
  }
  leave_out_fold(camera, window);
  expect(window.u_max_px > window.u_min_px && window.v_max_px > window.v_min_px);
  return window;
}

}  // namespace lapservo
