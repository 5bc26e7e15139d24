#include "lapservo/sim/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <set>
#include <utility>

#include <opencv2/imgproc.hpp>

namespace lapservo {
namespace {

constexpr int tile_px = 32;
constexpr int samples_at_edges = 32;

// A rank-1 lattice: every sample has a row and a column of its own, so edges along the axes are as fine as any.
constexpr std::array<std::array<float, 2>, samples_at_edges> make_lattice() {
  std::array<std::array<float, 2>, samples_at_edges> lattice{};
  for (int i = 0; i < samples_at_edges; ++i)
    lattice[static_cast<std::size_t>(i)] = {
        (static_cast<float>(i) + 0.5F) / samples_at_edges - 0.5F,
        (static_cast<float>((i * 19 + 7) % samples_at_edges) + 0.5F) / samples_at_edges - 0.5F};
  return lattice;
}
constexpr auto lattice = make_lattice();

int margin_px(double blur_px) {
  return static_cast<int>(std::ceil(4 * blur_px)) + 1;
}

void blur(const cv::Mat& in, cv::Mat& out, double blur_px) {
  if (blur_px <= 0) {
    in.copyTo(out);
    return;
  }
  const int size = 2 * margin_px(blur_px) - 1;
  cv::GaussianBlur(in, out, {size, size}, blur_px, blur_px, cv::BORDER_REPLICATE);
}

// Nearest shaft on a ray.
std::pair<ShaftCaster::Hit, const ShaftCaster*> nearest(const std::vector<ShaftCaster>& casters,
                                                        const Eigen::Vector3d& ray) {
  std::pair<ShaftCaster::Hit, const ShaftCaster*> best{{}, nullptr};
  for (const ShaftCaster& caster : casters) {
    const ShaftCaster::Hit hit = caster.cast(ray);
    if (hit.part && hit.depth_m < best.first.depth_m) best = {hit, &caster};
  }
  return best;
}

// Image of the shaft's outline, generously: the tiles within its width of its axis.
void tiles_near(const Camera& camera, const ShaftModel& model, const ShaftPlacement& placement, double extra_px,
                std::set<std::pair<int, int>>& tiles) {
  const double from_m = -model.shaft_before_m,
               to_m = model.marker.length_m() + model.shaft_beyond_m + 1.2 * model.marker.radius_m();
  double along_m = from_m;
  while (along_m < to_m) {
    const Eigen::Vector3d point = placement.camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
    const double z_m = point.z();
    along_m += std::max(0.0005, 0.3 * tile_px * std::max(z_m, 0.01) / camera.fx_px);
    if (z_m < 2 * model.marker.radius_m()) continue;
    const Eigen::Vector2d centre = camera.raw_from_point(point);
    const double reach_px =
        1.6 * model.marker.radius_m() * camera.fx_px / (z_m - model.marker.radius_m()) + extra_px + tile_px;
    if (!camera.contains(centre, -2 * reach_px)) continue;
    const auto tile = [](double x) { return static_cast<int>(std::floor(x / tile_px)); };
    for (int r = tile(centre.y() - reach_px); r <= tile(centre.y() + reach_px); ++r)
      for (int c = tile(centre.x() - reach_px); c <= tile(centre.x() + reach_px); ++c) tiles.emplace(r, c);
  }
}

}  // namespace

Renderer::Renderer(const Camera& camera, std::vector<ShaftModel> shafts, const cv::Mat& background,
                   RenderOptions options)
    : camera_(camera), shafts_(std::move(shafts)), options_(options), encoder_(camera.response, options.sensor) {
  CV_Assert(background.type() == CV_32FC3 && background.cols == camera.width_px && background.rows == camera.height_px);
  sharp_ = background * (1 - options_.smoke) + cv::Scalar::all(0.35 * options_.smoke);
  light_ = sharp_.clone();
  cv::Mat blurred;
  blur(sharp_, blurred, options_.sensor.blur_px);
  background_ = encoder_.allocate(sharp_.size());
  encoder_.encode(blurred, background_.value, background_.sigma);
  frame_ = {background_.value.clone(), background_.sigma.clone()};
  if (!camera_.distorted()) return;
  rays_.create(camera.height_px, camera.width_px, CV_64FC2);
  for (int v = 0; v < rays_.rows; ++v)
    for (int u = 0; u < rays_.cols; ++u) {
      const auto ideal = camera_.ideal_from_raw({u, v});
      const Eigen::Vector3d direction = camera_.ray_from_ideal(ideal.value_or(Eigen::Vector2d(u, v)));
      rays_.at<cv::Vec2d>(v, u) = {direction.x(), direction.y()};
    }
}

Eigen::Vector3d Renderer::ray(double u, double v) const {
  if (rays_.empty()) return camera_.ray_from_ideal({u, v});
  // Bilinear: the rays of neighbouring pixels differ by nearly the same everywhere.
  const int iu = std::clamp(static_cast<int>(std::floor(u)), 0, rays_.cols - 2),
            iv = std::clamp(static_cast<int>(std::floor(v)), 0, rays_.rows - 2);
  const double fu = u - iu, fv = v - iv;
  const cv::Vec2d top = rays_.at<cv::Vec2d>(iv, iu) * (1 - fu) + rays_.at<cv::Vec2d>(iv, iu + 1) * fu;
  const cv::Vec2d bottom = rays_.at<cv::Vec2d>(iv + 1, iu) * (1 - fu) + rays_.at<cv::Vec2d>(iv + 1, iu + 1) * fu;
  const cv::Vec2d direction = top * (1 - fv) + bottom * fv;
  return {direction[0], direction[1], 1};
}

void Renderer::draw_tile(const std::vector<ShaftCaster>& casters, const cv::Rect& tile, float share) {
  constexpr int side = tile_px + 2;
  std::array<std::uint16_t, side * side> parts{};
  std::array<Light, side * side> colors;
  const float clear = 1 - options_.smoke;
  const Light veil = Light::Constant(0.35F * options_.smoke);
  for (int v = -1; v <= tile.height; ++v)
    for (int u = -1; u <= tile.width; ++u) {
      const auto [hit, caster] = nearest(casters, ray(tile.x + u, tile.y + v));
      const auto index = static_cast<std::size_t>((v + 1) * side + u + 1);
      parts[index] = hit.part ? static_cast<std::uint16_t>(hit.part + 64 * (caster - casters.data())) : 0;
      if (hit.part) colors[index] = caster->shade(hit);
    }
  for (int v = 0; v < tile.height; ++v)
    for (int u = 0; u < tile.width; ++u) {
      const auto index = static_cast<std::size_t>((v + 1) * side + u + 1);
      const std::uint16_t part = parts[index];
      bool edge = false;
      for (int dv = -1; dv <= 1; ++dv)
        for (int du = -1; du <= 1; ++du) edge |= parts[index + static_cast<std::size_t>(dv * side + du)] != part;
      if (!edge && !part) continue;
      Light sum = Light::Zero();
      float covered = 1;
      if (!edge) {
        sum = colors[index];
      } else {
        int hits = 0;
        for (const auto& offset : lattice) {
          const auto [hit, caster] = nearest(casters, ray(tile.x + u + offset[0], tile.y + v + offset[1]));
          if (!hit.part) continue;
          sum += caster->shade(hit);
          ++hits;
        }
        sum /= samples_at_edges;
        covered = static_cast<float>(hits) / samples_at_edges;
      }
      const auto& behind = sharp_.at<cv::Vec3f>(tile.y + v, tile.x + u);
      auto& pixel = light_.at<cv::Vec3f>(tile.y + v, tile.x + u);
      for (int c = 0; c < 3; ++c) pixel[c] += share * (clear * sum[c] + covered * (veil[c] - behind[c]));
    }
}

void Renderer::draw(const std::vector<ShaftPlacement>& placements, float share, std::vector<cv::Rect>& touched) {
  std::vector<ShaftCaster> casters;
  std::set<std::pair<int, int>> tiles;
  for (std::size_t i = 0; i < placements.size(); ++i) {
    casters.emplace_back(shafts_.at(i), placements[i], options_.lighting);
    tiles_near(camera_, shafts_[i], placements[i], margin_px(options_.sensor.blur_px), tiles);
  }
  const cv::Rect whole(0, 0, camera_.width_px, camera_.height_px);
  for (const auto& [row, column] : tiles) {
    const cv::Rect tile = cv::Rect(column * tile_px, row * tile_px, tile_px, tile_px) & whole;
    if (tile.empty()) continue;
    draw_tile(casters, tile, share);
    touched.push_back(tile);
  }
}

cv::Mat Renderer::render(const std::vector<ShaftPlacement>& placements, std::uint64_t seed) {
  return render_exposure({placements}, seed);
}

cv::Mat Renderer::render_exposure(const Exposure& exposure, std::uint64_t seed) {
  std::vector<cv::Rect> tiles;
  for (const auto& moment : exposure) draw(moment, 1.0F / static_cast<float>(exposure.size()), tiles);
  const int margin = margin_px(options_.sensor.blur_px);
  const cv::Rect whole(0, 0, camera_.width_px, camera_.height_px);
  cv::Mat blurred;
  for (const cv::Rect& tile : tiles) {
    const cv::Rect around =
        cv::Rect(tile.x - margin, tile.y - margin, tile.width + 2 * margin, tile.height + 2 * margin) & whole;
    blur(light_(around), blurred, options_.sensor.blur_px);
    encoder_.encode(blurred(tile - around.tl()), frame_.value(tile), frame_.sigma(tile));
  }
  cv::Mat image;
  encoder_.expose(frame_, seed, image);
  for (const cv::Rect& tile : tiles) {
    sharp_(tile).copyTo(light_(tile));
    background_.value(tile).copyTo(frame_.value(tile));
    background_.sigma(tile).copyTo(frame_.sigma(tile));
  }
  return image;
}

}  // namespace lapservo
