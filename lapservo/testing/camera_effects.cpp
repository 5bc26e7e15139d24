#include "lapservo/testing/camera_effects.h"

#include <array>
#include <cmath>
#include <functional>
#include <map>

#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/sim/chromatic_aberration.h"

namespace lapservo::effects {
using namespace internal;
namespace {

// Applies a function to each value of a float image.
void map_values(cv::Mat& picture, const std::function<double(double)>& function) {
  constexpr int levels = 4096;
  std::vector<float> table(levels + 2);
  for (int i = 0; i <= levels + 1; ++i)
    table[static_cast<std::size_t>(i)] =
        static_cast<float>(function(std::pow(std::min(1.0, static_cast<double>(i) / levels), 2)));
  auto* const values = picture.ptr<float>();
  const std::size_t count = 3 * picture.total();
  for (std::size_t at = 0; at < count; ++at) {
    const float place = std::sqrt(std::clamp(values[at], 0.0F, 1.0F)) * levels;
    const int i = static_cast<int>(place);
    const float* const entry = table.data() + i;
    values[at] = entry[0] + (place - static_cast<float>(i)) * (entry[1] - entry[0]);
  }
}

void vignette(cv::Mat& light, double fraction, const Camera& camera) {
  if (fraction == 0) return;
  const double corner_px = std::hypot(camera.width_px, camera.height_px) / 2;
  for (int v = 0; v < light.rows; ++v)
    for (int u = 0; u < light.cols; ++u) {
      const double r = std::hypot(u - camera.cx_px, v - camera.cy_px) / corner_px;
      light.at<cv::Vec3f>(v, u) *= static_cast<float>(1 - fraction * r * r);
    }
}

void cross_talk(cv::Mat& light, double fraction) {
  if (fraction == 0) return;
  cv::Matx33f mix = cv::Matx33f::all(static_cast<float>(fraction));
  for (int c = 0; c < 3; ++c) mix(c, c) = static_cast<float>(1 - 2 * fraction);
  cv::transform(light, light, mix);
}

void demosaic(cv::Mat& light) {
  cv::Mat mosaic(light.size(), CV_16UC1), out;
  for (int v = 0; v < light.rows; ++v)
    for (int u = 0; u < light.cols; ++u) {  // red at (0, 0), blue at (1, 1)
      const int channel = v % 2 == 0 ? (u % 2 == 0 ? 2 : 1) : (u % 2 == 0 ? 1 : 0);
      mosaic.at<std::uint16_t>(v, u) = cv::saturate_cast<std::uint16_t>(65535 * light.at<cv::Vec3f>(v, u)[channel]);
    }
  cv::cvtColor(mosaic, out, cv::COLOR_BayerBG2BGR);
  out.convertTo(light, CV_32F, 1 / 65535.0);
}

double s_curve(double contrast, double value) {
  return value - contrast * std::sin(two_pi * value) / two_pi;
}

// BGR in [0, 1] to Y, Cb, Cr (Rec. 601, full range, colour differences about 0), and back.
const cv::Matx33f ycc_from_bgr{0.114F, 0.587F, 0.299F, 0.5F, -0.331264F, -0.168736F, -0.081312F, -0.418688F, 0.5F};

void saturate(cv::Mat& picture, double saturation) {
  if (saturation == 1) return;
  const auto s = static_cast<float>(saturation);
  const cv::Matx33f scale{1, 0, 0, 0, s, 0, 0, 0, s};
  cv::transform(picture, picture, ycc_from_bgr.inv() * scale * ycc_from_bgr);
}

void sharpen(cv::Mat& picture, double amount, double sigma_px) {
  if (amount == 0) return;
  cv::Mat blurred;
  cv::GaussianBlur(picture, blurred, {}, sigma_px, sigma_px, cv::BORDER_REPLICATE);
  cv::addWeighted(picture, 1 + amount, blurred, -amount, 0, picture);
  picture = cv::max(cv::min(picture, cv::Scalar::all(1)), cv::Scalar::all(0));
}

// A colour difference at half the resolution and back.
cv::Mat subsampled(const cv::Mat& chroma, bool left_sited) {
  const cv::Size half((chroma.cols + 1) / 2, (chroma.rows + 1) / 2);
  cv::Mat small, out;
  if (!left_sited) {
    cv::resize(chroma, small, half, 0, 0, cv::INTER_AREA);
    cv::resize(small, out, chroma.size(), 0, 0, cv::INTER_LINEAR);
    return out;
  }
  // Columns: 1 2 1 about every other one. Rows: as above.
  const cv::Mat columns = (cv::Mat_<float>(1, 3) << 0.25F, 0.5F, 0.25F), one = cv::Mat::ones(1, 1, CV_32F);
  cv::Mat filtered;
  cv::sepFilter2D(chroma, filtered, CV_32F, columns, one, {-1, -1}, 0, cv::BORDER_REPLICATE);
  cv::resize(filtered, small, {chroma.cols, half.height}, 0, 0, cv::INTER_AREA);
  cv::resize(small, out, chroma.size(), 0, 0, cv::INTER_LINEAR);
  for (int v = 0; v < out.rows; ++v)
    for (int u = 1; u + 1 < out.cols; u += 2)
      out.at<float>(v, u) = (out.at<float>(v, u - 1) + out.at<float>(v, u + 1)) / 2;
  return out;
}

void subsample(cv::Mat& picture, bool left_sited) {
  cv::transform(picture, picture, ycc_from_bgr);
  std::array<cv::Mat, 3> channels;
  cv::split(picture, channels.data());
  for (const std::size_t c : {1U, 2U}) channels[c] = subsampled(channels[c], left_sited);
  cv::merge(channels.data(), channels.size(), picture);
  cv::transform(picture, picture, ycc_from_bgr.inv());
}

cv::Mat compressed(const cv::Mat& picture, int quality) {
  if (quality == 0) return picture;
  return decode_image(encode_jpeg(picture, quality), "an image of a test");
}

// Linear light of an sRGB image.
cv::Mat light_of(const cv::Mat& srgb) {
  LightTable table = Response{}.table();
  cv::Mat light;
  cv::LUT(srgb, cv::Mat(1, 256, CV_32F, table.data()), light);
  return light;
}

Response response_of(const CameraEffects& effects) {
  return {effects.rec709 ? Response::Kind::rec709 : Response::Kind::srgb};
}

}  // namespace

cv::Mat seen_through(const CameraEffects& effects, const cv::Mat& srgb, const Camera& camera) {
  const cv::Mat sharp = light_of(srgb);
  cv::Mat picture = sharp.clone();
  Camera lens = camera;
  lens.chromatic_aberration = effects.aberration;
  aberrate(lens, sharp, {{0, 0}, sharp.size()}, picture);
  vignette(picture, effects.vignette, camera);
  cross_talk(picture, effects.crosstalk);
  if (effects.mosaic) demosaic(picture);
  const Response response = response_of(effects);
  map_values(picture, [&](double light) { return s_curve(effects.contrast, response.value_from_light(light)); });
  saturate(picture, effects.saturation);
  sharpen(picture, effects.sharpening, effects.sharpening_px);
  if (effects.subsampled) subsample(picture, effects.left_sited);
  cv::Mat out;
  picture.convertTo(out, CV_8U, 255);
  return compressed(out, effects.jpeg_quality);
}

Camera calibrated(const CameraEffects& effects, const Camera& camera) {
  Camera out = camera;
  out.chromatic_aberration = effects.aberration;
  out.response = response_of(effects);
  if (effects.contrast == 0) return out;
  const Response encoded = response_of(effects);
  out.response = {Response::Kind::table};
  constexpr int points = 64;
  for (int i = 0; i <= points; ++i) {
    const double value = static_cast<double>(i) / points;
    out.response.table_light.push_back(encoded.light_from_value(value));
    out.response.table_value.push_back(s_curve(effects.contrast, value));
  }
  return out;
}

const std::vector<std::string>& conditions() {
  static const std::vector<std::string> names{"none", "ca",      "vignette",  "crosstalk", "bayer", "rec709",
                                              "tone", "sharpen", "chroma420", "jpeg",      "camera"};
  return names;
}

CameraEffects draw(const std::string& condition, std::uint64_t seed) {
  Random random(seed);
  const double magnification = random.uniform(5e-4, 1e-3), more = random.uniform(0, 1);
  const bool left_sited = random.uniform(0, 1) < 0.5;
  const double radius_px = random.uniform(0.8, 1.6);
  CameraEffects all;
  all.aberration = {1 + magnification, 1 - magnification};
  all.vignette = 0.3 + 0.2 * more;
  all.crosstalk = 0.04 + 0.06 * more;
  all.mosaic = true;
  all.contrast = 0.2 + 0.2 * more;
  all.saturation = 1.1 + 0.2 * more;
  all.sharpening = 0.4 + 0.6 * more, all.sharpening_px = radius_px;
  all.left_sited = left_sited;
  const std::map<std::string, std::function<void(CameraEffects&)>> parts{
      {"none", [](CameraEffects&) {}},
      {"ca", [&](CameraEffects& e) { e.aberration = all.aberration; }},
      {"vignette", [&](CameraEffects& e) { e.vignette = all.vignette; }},
      {"crosstalk", [&](CameraEffects& e) { e.crosstalk = all.crosstalk; }},
      {"bayer", [&](CameraEffects& e) { e.mosaic = true; }},
      {"rec709", [&](CameraEffects& e) { e.rec709 = true; }},
      {"tone", [&](CameraEffects& e) { e.contrast = all.contrast, e.saturation = all.saturation; }},
      {"sharpen", [&](CameraEffects& e) { e.sharpening = all.sharpening, e.sharpening_px = radius_px; }},
      {"chroma420", [&](CameraEffects& e) { e.subsampled = true, e.left_sited = left_sited; }},
      {"jpeg", [&](CameraEffects& e) { e.jpeg_quality = 85; }},
      {"camera",
       [&](CameraEffects& e) {
         e = all;
         e.aberration = {1 + magnification / 2, 1 - magnification / 2};
         e.contrast = 0, e.saturation = 1, e.sharpening /= 2, e.subsampled = true, e.jpeg_quality = 85;
       }},
      {"strong_tone", [&](CameraEffects& e) { e.contrast = 0.3 + 0.2 * more, e.saturation = 1.3 + 0.4 * more; }},
      {"processed", [&](CameraEffects& e) {
         e.mosaic = true, e.contrast = 0.3 + 0.2 * more, e.saturation = 1.3 + 0.4 * more;
         e.sharpening = all.sharpening / 2, e.sharpening_px = radius_px;
         e.subsampled = true, e.left_sited = left_sited, e.jpeg_quality = 85;
       }}};
  CameraEffects effects;
  parts.at(condition)(effects);
  return effects;
}

}  // namespace lapservo::effects
