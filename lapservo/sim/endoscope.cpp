#include "lapservo/sim/endoscope.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/core/workers.h"
#include "lapservo/sim/same_moment.h"

namespace lapservo {
using namespace internal;
namespace {

bool is_being_rendered(const std::future<cv::Mat>& picture) {
  return picture.valid() && picture.wait_for(std::chrono::seconds(0)) == std::future_status::timeout;
}

void check(bool right, const char* field, double value, const char* expected) {
  if (!right) throw InputError("endoscope", field, fmt::format("{}", value), expected);
}

}  // namespace

const EndoscopeConfig& EndoscopeConfig::checked() const {
  check(frame_rate_hz >= 1 && frame_rate_hz <= 1000, "frame_rate_hz", frame_rate_hz, "1 to 1000");
  check(exposure_s >= 0 && exposure_s <= 1 / frame_rate_hz, "exposure_s", exposure_s, "0 to the time between frames");
  check(exposure_moments >= 2 && exposure_moments <= 100, "exposure_moments", exposure_moments, "2 to 100");
  check(latency_s >= exposure_s / 2 && latency_s <= 10, "latency_s", latency_s, "half the exposure to 10");
  check(jitter_s >= 0 && jitter_s <= 1, "jitter_s", jitter_s, "0 to 1");
  check(dropped_fraction >= 0 && dropped_fraction <= 1, "dropped_fraction", dropped_fraction, "0 to 1");
  check(render_threads >= 0 && render_threads <= 64, "render_threads", render_threads, "0 to 64");
  return *this;
}

// Renders in whichever thread is free, each with a renderer of its own.
struct Endoscope::Queue {
  Queue(Renderer renderer, int threads) : workers(threads) {
    for (int i = 1; i < threads; ++i) renderers.push_back(renderer.clone());
    renderers.push_back(std::move(renderer));
  }
  std::vector<Renderer> renderers;
  Workers workers;  // the first to go: they use the renderers
};

Endoscope::Endoscope(const Camera& camera, const std::vector<ShaftModel>& shafts, const cv::Mat& background,
                     const RenderOptions& options, const EndoscopeConfig& config, std::uint64_t seed)
    : config_(config.checked()), gains_(options.sensor.gains), seed_(seed) {
  if (config.pictures)
    queue_ = std::make_unique<Queue>(Renderer(camera, shafts, background, options), config.render_threads);
}

Endoscope::~Endoscope() = default;
Endoscope::Endoscope(Endoscope&&) noexcept = default;
Endoscope& Endoscope::operator=(Endoscope&&) noexcept = default;

std::vector<double> Endoscope::next_moments_s() const {
  const double opens_s = static_cast<double>(next_) / config_.frame_rate_hz;
  if (config_.exposure_s <= 0) return {opens_s};
  std::vector<double> moments_s;
  for (int m = 0; m < config_.exposure_moments; ++m)
    moments_s.push_back(opens_s + config_.exposure_s * (m + 0.5) / config_.exposure_moments);
  return moments_s;
}

void Endoscope::expose(const Exposure& shafts) {
  // A generator for each frame: what one frame draws doesn't change another.
  Random random(seed_ + 0x632be59bd9b4e019ULL * static_cast<std::uint64_t>(next_ + 1));
  const bool dropped = random.uniform() < config_.dropped_fraction;
  const double jitter_s = random.uniform(-config_.jitter_s, config_.jitter_s);
  const std::uint64_t noise_seed = random.bits();
  EndoscopePicture picture;
  picture.index = next_;
  picture.exposed_s = static_cast<double>(next_) / config_.frame_rate_hz + config_.exposure_s / 2;
  const double closes_s = picture.exposed_s + config_.exposure_s / 2;
  ++next_;
  if (dropped || falls_behind()) return;
  // Frames don't overtake one another, nor arrive before they are taken.
  picture.stamp_s = std::max({picture.exposed_s + config_.latency_s + jitter_s, closes_s, last_stamp_s_});
  last_stamp_s_ = picture.stamp_s;
  std::future<cv::Mat> rendered;
  if (queue_)
    rendered = queue_->workers.run(
        [&renderers = queue_->renderers, shafts, noise_seed, gains = Light(light_ * gains_)](std::size_t thread) {
          renderers[thread].set_gains(gains);
          return renderers[thread].render_exposure(shafts, noise_seed);
        });
  on_the_way_.push_back({std::move(picture), std::move(rendered)});
}

// In real time no frame waits for those before it: else each comes later than the last one.
bool Endoscope::falls_behind() const {
  const auto busy = std::ranges::count_if(on_the_way_, is_being_rendered, &OnTheWay::rendered);
  return config_.real_time && busy > 0 && busy >= config_.render_threads;
}

std::vector<EndoscopePicture> Endoscope::arrived(double time_s) {
  std::vector<EndoscopePicture> pictures;
  while (!on_the_way_.empty() && on_the_way_.front().picture.stamp_s <= time_s + same_moment_s) {
    OnTheWay& first = on_the_way_.front();
    if (config_.real_time && is_being_rendered(first.rendered)) break;
    if (first.rendered.valid()) first.picture.bgr = first.rendered.get();
    pictures.push_back(std::move(first.picture));
    on_the_way_.pop_front();
  }
  return pictures;
}

}  // namespace lapservo
