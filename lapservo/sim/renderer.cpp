#include "lapservo/sim/renderer.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "lapservo/geometry/field_of_view.h"
#include "lapservo/sim/chromatic_aberration.h"
#include "lapservo/sim/optics.h"
#include "lapservo/sim/outline.h"
#include "lapservo/sim/sensor.h"
#include "lapservo/sim/shaft_painter.h"
#include "lapservo/sim/tool_painter.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr float smoke_light = 0.35F;
constexpr float far_m = 1e9F;

// The same pixels without overlap; the parts of a band of rows share their top and height.
std::vector<cv::Rect> without_overlap(std::vector<cv::Rect> parts) {
  std::sort(parts.begin(), parts.end(),
            [](const cv::Rect& a, const cv::Rect& b) { return a.y != b.y ? a.y < b.y : a.x < b.x; });
  std::vector<cv::Rect> apart;
  for (const cv::Rect& part : parts) {
    if (!apart.empty() && apart.back().y == part.y && part.x <= apart.back().br().x)
      apart.back().width = std::max(apart.back().br().x, part.br().x) - apart.back().x;
    else
      apart.push_back(part);
  }
  return apart;
}

}  // namespace

class Renderer::State {
 public:
  State(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background, RenderOptions options)
      : camera_(camera),
        half_field_rad_(half_field_rad(camera)),
        shafts_(std::move(shafts)),
        options_(options),
        aberration_px_(aberration_reach_px(camera)),
        optics_(options.sensor.blur_px),
        encoder_(camera.response, options.sensor),
        rays_(camera) {
    CV_Assert(background.type() == CV_32FC3 && background.cols == camera.width_px &&
              background.rows == camera.height_px);
    background_light_ = background.clone();
    scene_.light = background.clone();
    lens_background_ = background_light_;
    if (aberration_px_ > 0) {
      lens_light_ = background.clone();
      aberrate(camera_, background_light_, {{0, 0}, background.size()}, lens_light_);
      lens_background_ = lens_light_.clone();
    }
    const bool has_tools =
        std::any_of(shafts_.begin(), shafts_.end(), [](const ShaftModel& shaft) { return shaft.tool.has_value(); });
    if (shafts_.size() > 1 || has_tools) {
      scene_.depth_m = cv::Mat(background.size(), CV_32F, cv::Scalar(far_m));
      scene_.cover = cv::Mat(background.size(), CV_32F, cv::Scalar(0));
    }
    develop_background();
  }

  cv::Mat render_exposure(const Exposure& exposure, std::uint64_t seed) {
    std::vector<cv::Rect> drawn;
    if (exposure.size() == 1) {
      drawn = draw(exposure.front());
      develop_parts(scene_.light, drawn);
      clear(drawn);
    } else {
      cv::Mat exposed = background_light_.clone();
      const double fraction = 1.0 / static_cast<double>(exposure.size());
      for (const auto& moment : exposure) {
        const std::vector<cv::Rect> now = draw(moment);
        for (const cv::Rect& part : now) exposed(part) += (scene_.light(part) - background_light_(part)) * fraction;
        clear(now);
        drawn.insert(drawn.end(), now.begin(), now.end());
      }
      drawn = without_overlap(std::move(drawn));
      develop_parts(exposed, drawn);
    }
    const cv::Mat image = encoder_.expose(frame_, seed);
    for (const cv::Rect& part : drawn) {
      background_.value(part).copyTo(frame_.value(part));
      background_.sigma(part).copyTo(frame_.sigma(part));
    }
    return image;
  }

  void set_gains(const Light& gains) {
    if (gains == options_.sensor.gains) return;
    options_.sensor.gains = gains;
    encoder_.set_gains(gains);
    develop_background();
  }

  std::unique_ptr<State> clone() const {
    return std::make_unique<State>(camera_, shafts_, background_light_, options_);
  }

 private:
  void develop_background() {
    background_ = encoder_.allocate(background_light_.size());
    develop(lens_background_, cv::Rect({0, 0}, background_light_.size()), background_);
    frame_ = {background_.value.clone(), background_.sigma.clone()};
  }

  std::vector<cv::Rect> draw(const std::vector<ShaftPlacement>& placements) {
    std::vector<cv::Rect> drawn;
    const double margin_px = optics_.reach_px() + aberration_px_ + 1;
    const auto paint = [&](const std::vector<Capsule>& things, auto painter) {
      for (const cv::Rect& part : outline(camera_, half_field_rad_, things, margin_px)) {
        painter.paint(rays_, part, background_light_, scene_);
        drawn.push_back(part);
      }
    };
    for (std::size_t i = 0; i < placements.size(); ++i) {
      const ShaftModel& shaft = shafts_.at(i);
      const auto on_axis = [&](double along_m) -> Eigen::Vector3d {
        return placements[i].camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
      };
      const Capsule whole{on_axis(-shaft.shaft_before_m), on_axis(shaft.marker.length_m() + shaft.shaft_beyond_m),
                          shaft.tip_radius_m()};
      const Disc tip = disc_around_ball(camera_, half_field_rad_, whole.to_m, whole.radius_m);
      paint({whole}, ShaftPainter(shaft, placements[i], options_.lighting, tip));
      const std::vector<Capsule> links = tool_links(shaft, placements[i]);
      paint(links, ToolPainter(links, options_.lighting));
    }
    return without_overlap(std::move(drawn));
  }

  void clear(const std::vector<cv::Rect>& drawn) {
    for (const cv::Rect& part : drawn) {
      background_light_(part).copyTo(scene_.light(part));
      if (scene_.cover.empty()) continue;
      scene_.depth_m(part).setTo(far_m);
      scene_.cover(part).setTo(0);
    }
  }

  // Parts of the frame, as the lens shows them.
  void develop_parts(const cv::Mat& light, const std::vector<cv::Rect>& drawn) {
    if (aberration_px_ == 0) {
      for (const cv::Rect& part : drawn) develop(light, part, frame_);
      return;
    }
    for (const cv::Rect& part : drawn) aberrate(camera_, light, part, lens_light_);
    for (const cv::Rect& part : drawn) develop(lens_light_, part, frame_);
    for (const cv::Rect& part : drawn) lens_background_(part).copyTo(lens_light_(part));
  }

  // Blurs, veils and encodes a part. A veil is even: it may come after the blur.
  void develop(const cv::Mat& light, const cv::Rect& part, SensorEncoder::Encoded& encoded) {
    const float clear = 1 - options_.smoke, veil = smoke_light * options_.smoke;
    veiled_.resize(static_cast<std::size_t>(3 * part.width));
    for (int v = part.y; v < part.y + part.height; ++v) {
      const float* row = optics_.row(light, v, part.x, part.x + part.width);
      if (options_.smoke > 0) {
        for (std::size_t i = 0; i < veiled_.size(); ++i) veiled_[i] = clear * row[i] + veil;
        row = veiled_.data();
      }
      encoder_.encode(row, part.width, v, part.x, encoded);
    }
  }

  Camera camera_;
  double half_field_rad_;
  std::vector<ShaftModel> shafts_;
  RenderOptions options_;
  int aberration_px_;
  Optics optics_;
  SensorEncoder encoder_;
  PixelRays rays_;
  SceneLight scene_;                           // the frame being drawn
  cv::Mat background_light_;                   // sharp
  cv::Mat lens_background_, lens_light_;       // with the lens's chromatic aberration; the latter only where it has one
  SensorEncoder::Encoded background_, frame_;  // blurred and encoded
  std::vector<float> veiled_;
};

Renderer::Renderer(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background,
                   RenderOptions options)
    : state_(std::make_unique<State>(camera, std::move(shafts), background, options)) {}
Renderer::Renderer(std::unique_ptr<State> state) : state_(std::move(state)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

cv::Mat Renderer::render(const std::vector<ShaftPlacement>& placements, std::uint64_t seed) {
  return state_->render_exposure({placements}, seed);
}

cv::Mat Renderer::render_exposure(const Exposure& exposure, std::uint64_t seed) {
  return state_->render_exposure(exposure, seed);
}

void Renderer::set_gains(const Light& gains) {
  state_->set_gains(gains);
}

Renderer Renderer::clone() const {
  return Renderer(state_->clone());
}

}  // namespace lapservo
