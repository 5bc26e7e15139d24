#include "lapservo/vision/tracker.h"

#include <string>

#include "lapservo/core/error.h"
#include "lapservo/vision/centerline.h"
#include "lapservo/vision/surface_tracker.h"

namespace lapservo {
namespace {

std::string size_text(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

void check_image(const cv::Mat& image, const Camera& camera) {
  if (image.type() != CV_8UC3) throw InputError("image", "pixel type", "another", "8-bit BGR");
  if (image.cols != camera.width_px || image.rows != camera.height_px)
    throw InputError("image", "size", size_text(image.cols, image.rows),
                     size_text(camera.width_px, camera.height_px) + " as in the rig");
}

}  // namespace

struct Tracker::State {
  State(const Rig& rig, TrackerOptions options)
      : camera(rig.camera), method(options.method), surface(rig, options.single), centerline(rig) {}

  Camera camera;
  Method method;
  SurfaceTracker surface;
  CenterlineMethod centerline;
  std::vector<Observation> observations;
};

Tracker::Tracker(const Rig& rig, TrackerOptions options) : state_(std::make_unique<State>(rig, options)) {}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;

const std::vector<Observation>& Tracker::track(const cv::Mat& image_bgr) & {
  check_image(image_bgr, state_->camera);
  if (state_->method == Method::surface) return state_->surface.track(image_bgr);
  state_->observations = state_->centerline.observe(image_bgr);
  return state_->observations;
}

std::vector<Observation> Tracker::track(const cv::Mat& image_bgr) && {
  return track(image_bgr);  // the overload above: *this is an lvalue here
}

void Tracker::reset() {
  state_->surface.reset();
}

}  // namespace lapservo
