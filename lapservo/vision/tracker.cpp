#include "lapservo/vision/tracker.h"

#include <string>

#include "lapservo/core/error.h"
#include "lapservo/core/words.h"
#include "lapservo/rig/check_rig.h"
#include "lapservo/tool/wrist.h"
#include "lapservo/vision/decision/fit_observation.h"
#include "lapservo/vision/image/interlacing.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/paper/centerline.h"
#include "lapservo/vision/surface_tracker.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr Words<Method, 2> method_words{{{Method::surface, "surface"}, {Method::centerline, "centerline"}}};
static_assert(names_all(method_words, Method::centerline));

std::string size_text(int width_px, int height_px) {
  return std::to_string(width_px) + "x" + std::to_string(height_px);
}

void check_image(const cv::Mat& image, const Camera& camera) {
  if (image.type() != CV_8UC3) throw InputError("image", "pixel type", "another", "8-bit BGR");
  if (image.cols != camera.width_px || image.rows != camera.height_px)
    throw InputError("image", "size", size_text(image.cols, image.rows),
                     size_text(camera.width_px, camera.height_px) + " as in the rig");
}

TrackerOptions checked(TrackerOptions options) {
  if (options.frame_budget && !(*options.frame_budget > 0))
    throw InputError("tracker", "frame_budget", std::to_string(*options.frame_budget), "above 0, or none");
  if (!(options.max_p_false > 0 && options.max_p_false <= 1))
    throw InputError("tracker", "max_p_false", std::to_string(options.max_p_false), "above 0, at most 1");
  return options;
}

Observation refused_as_interlaced(const Observation& observation, Method method) {
  using What = Observation::Refused::What;
  Observation refused = refused_observation(Status::interlaced);
  refused.refused = observation.refused;
  if (observation.status == Status::ok)
    refused.refused = {method == Method::surface ? What::pose : What::edges, observation.camera_from_unrolled,
                       observation.psi_rad, observation.edges_raw_px};
  return refused;
}

}  // namespace

std::string_view to_string(Method method) {
  return word_of(method_words, method);
}

std::optional<Method> method_from_string(std::string_view word) {
  return read_word(method_words, word);
}

struct Tracker::State {
  State(const Rig& of_rig, TrackerOptions options)
      : rig(of_rig),
        method(options.method),
        deinterlace(options.deinterlace || rig.camera.deinterlace),
        even_field(rig.camera.response),
        wrists(rig.instruments.size()),
        surface(rig, options),
        centerline(rig) {}

  void observe(const cv::Mat& image_bgr, std::optional<double> time_s) {
    if (method == Method::surface)
      observations = surface.track(image_bgr, time_s);
    else
      observations = centerline.observe(image_bgr);
  }
  const std::vector<Observation>& with_names_and_tips() {
    for (std::size_t i = 0; i < observations.size(); ++i) {
      observations[i].instrument = rig.instruments[i].name;
      if (const auto& tool = rig.instruments[i].tool) observations[i].tip = tip_of(observations[i], *tool, wrists[i]);
    }
    return observations;
  }
  // A frame between two moments is no observation of either, and nothing to start the next frame from.
  void refuse_combed(const cv::Mat& image_bgr) {
    const ImageView image(image_bgr);
    for (std::size_t i = 0; i < observations.size(); ++i) {
      if (!is_combed(image, rig.camera, rig.instruments[i].marker, observations[i])) continue;
      observations[i] = refused_as_interlaced(observations[i], method);
      surface.disregard_frame(i);
    }
  }

  Rig rig;
  Method method;
  bool deinterlace;
  EvenField even_field;
  std::vector<std::vector<double>> wrists;
  SurfaceTracker surface;
  CenterlineMethod centerline;
  std::vector<Observation> observations;
};

Tracker::Tracker(const Rig& rig, TrackerOptions options) {
  check_rig(rig);
  state_ = std::make_unique<State>(rig, checked(options));
}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;

const std::vector<Observation>& Tracker::track(const cv::Mat& image_bgr, std::optional<double> time_s) & {
  check_image(image_bgr, state_->rig.camera);
  state_->observe(state_->deinterlace ? state_->even_field.of(image_bgr) : image_bgr, time_s);
  if (!state_->deinterlace) state_->refuse_combed(image_bgr);
  return state_->with_names_and_tips();
}

std::vector<Observation> Tracker::track(const cv::Mat& image_bgr) && {
  state_->surface.search_frames_whole();
  return track(image_bgr);  // the overload above: *this is an lvalue here
}

void Tracker::set_registration(std::size_t instrument, const Rigid3& camera_from_rcm,
                               const Eigen::Matrix<double, 6, 6>& covariance) {
  Instrument& moved = state_->rig.instruments.at(instrument);
  if (!camera_from_rcm.translation.allFinite() || !camera_from_rcm.rotation.coeffs().allFinite() ||
      !covariance.allFinite())
    throw InputError("tracker", "camera_from_rcm", "not finite", "finite numbers");
  moved.camera_from_rcm = camera_from_rcm;
  moved.registration_covariance = covariance;
  state_->surface.set_registration(instrument, moved);
}

void Tracker::set_wrist(std::size_t instrument, std::span<const double> wrist_rad) {
  const std::optional<Tool>& tool = state_->rig.instruments.at(instrument).tool;
  if (!wrist_rad.empty()) expect_wrist(tool.value_or(Tool{}), wrist_rad);
  state_->wrists[instrument].assign(wrist_rad.begin(), wrist_rad.end());
}

const std::vector<Observation>& Tracker::refuse(Status why) & {
  for (std::size_t i = 0; i < state_->rig.instruments.size(); ++i) state_->surface.forget(i);
  state_->observations.assign(state_->rig.instruments.size(), refused_observation(why));
  return state_->with_names_and_tips();
}

void Tracker::reset() {
  state_->surface.forget();
}

}  // namespace lapservo
