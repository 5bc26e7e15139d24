#include "lapservo/sim/shaft_painter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

namespace lapservo::internal {
namespace {

// Beyond these azimuths, curvature within a pixel counts: near the silhouettes.
constexpr float flat_rad = 1.2F, contour_rad = 1.35F;

float mean(const std::array<float, 4>& values) {
  return 0.25F * (values[0] + values[1] + values[2] + values[3]);
}

// Bare plastic reflects less than the film.
float polish(Part part) {
  return part == Part::shaft ? 0.8F : 1.0F;
}

bool on_side(Part part) {
  return is_band(part) || part == Part::shaft || part == Part::blood;
}

}  // namespace

PixelRays::PixelRays(const Camera& camera) : camera_(camera) {
  if (!camera.distorted()) return;
  x_.create(camera.height_px + 1, camera.width_px + 1, CV_32F);
  y_.create(x_.size(), CV_32F);
  for (int v = 0; v < x_.rows; ++v)
    for (int u = 0; u < x_.cols; ++u) {
      const Eigen::Vector2d corner(u - 0.5, v - 0.5);
      const Eigen::Vector3d ray = camera.ray_from_ideal(camera.ideal_from_raw(corner).value_or(corner));
      x_.at<float>(v, u) = static_cast<float>(ray.x());
      y_.at<float>(v, u) = static_cast<float>(ray.y());
    }
}

void PixelRays::fill(RayRow& rays, int begin, int v) const {
  if (!x_.empty()) {
    std::copy_n(x_.ptr<float>(v, begin), rays.size(), rays.x.data());
    std::copy_n(y_.ptr<float>(v, begin), rays.size(), rays.y.data());
    return;
  }
  const auto y = static_cast<float>((v - 0.5 - camera_.cy_px) / camera_.fy_px);
  const double first = begin - 0.5 - camera_.cx_px, per_px = 1 / camera_.fx_px;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    rays.x[i] = static_cast<float>((first + static_cast<double>(i)) * per_px);
    rays.y[i] = y;
  }
}

void blend(const Paint& paint, float depth_m, const cv::Vec3f& background, cv::Vec3f& pixel, float& nearest_m,
           float& cover) {
  const bool in_front = depth_m < nearest_m;
  const float seen = in_front ? 1 : 1 - cover;
  for (int c = 0; c < 3; ++c) {
    const float hidden = in_front ? pixel[c] : background[c];
    pixel[c] += seen * (paint.light[c] - paint.cover * hidden);
  }
  cover += (1 - cover) * paint.cover;
  nearest_m = std::min(nearest_m, depth_m);
}

ShaftPainter::ShaftPainter(const ShaftModel& model, const ShaftPlacement& placement, const Lighting& lighting,
                           const Disc& tip)
    : tracer_(model, placement), lighting_(lighting, tracer_), reflectances_(reflectances(model)), tip_(tip) {
  if (model.cells.rows > 0) {
    reflectances_.at(static_cast<std::size_t>(Part::band_0)) = Light::Constant(PrintedCells::bright_reflectance);
    reflectances_.at(static_cast<std::size_t>(Part::band_2)) = Light::Constant(PrintedCells::dark_reflectance);
  }
  if (placement.covered)
    for (const Part band : {Part::band_0, Part::band_1, Part::band_2})
      reflectances_.at(static_cast<std::size_t>(band)) = reflectances_.at(static_cast<std::size_t>(Part::blood));
  samples_.resize(sample_lattice.size());
  single_.resize(1);
}

ShaftPainter::Corners ShaftPainter::corners(const RayRow& above, const RayRow& below, std::size_t i) {
  const auto around = [i](const auto& up, const auto& down) {
    return std::array{up[i], up[i + 1], down[i + 1], down[i]};
  };
  return {around(above.part, below.part),
          around(above.x, below.x),
          around(above.y, below.y),
          around(above.azimuth_rad, below.azimuth_rad),
          around(above.along_m, below.along_m),
          around(above.depth_m, below.depth_m)};
}

void ShaftPainter::paint(const PixelRays& rays, const cv::Rect& part, const cv::Mat& behind, SceneLight& scene) {
  if (!tracer_.visible()) return;
  const auto width = static_cast<std::size_t>(part.width);
  above_.resize(width + 1);
  below_.resize(width + 1);
  const auto trace = [&](RayRow& row, int v) {
    rays.fill(row, part.x, v);
    tracer_.trace(row, std::abs(v - tip_.centre_px.y()) < tip_.radius_px + 1);
  };
  trace(below_, part.y);
  for (int v = part.y; v < part.y + part.height; ++v) {
    std::swap(above_, below_);
    trace(below_, v + 1);
    auto* const light = scene.light.ptr<cv::Vec3f>(v, part.x);
    const auto* const background = behind.ptr<cv::Vec3f>(v, part.x);
    for (std::size_t i = 0; i < width; ++i) {
      if (above_.part[i] == Part::nothing && above_.part[i + 1] == Part::nothing && below_.part[i] == Part::nothing &&
          below_.part[i + 1] == Part::nothing)
        continue;
      const Corners at = corners(above_, below_, i);
      const Paint paint = paint_pixel(at);
      cv::Vec3f& pixel = light[i];
      if (scene.cover.empty()) {
        for (int c = 0; c < 3; ++c) pixel[c] += paint.light[c] - paint.cover * pixel[c];
        continue;
      }
      float depth_m = 1e9F;
      for (std::size_t k = 0; k < 4; ++k)
        if (at.part[k] != Part::nothing) depth_m = std::min(depth_m, at.depth_m[k]);
      blend(paint, depth_m, background[i], pixel, scene.depth_m.ptr<float>(v, part.x)[i],
            scene.cover.ptr<float>(v, part.x)[i]);
    }
  }
}

// Whether, for corners on the contours, the print's seam, and a gap that may be narrower than the pixel, lies between
// them.
bool ShaftPainter::spans_seam(const Corners& at) const {
  const auto tau = [&](std::size_t i) { return tracer_.tau_rad(at.azimuth_rad[i]); };
  for (std::size_t i = 1; i < 4; ++i)
    if (std::abs(tau(i) - tau(0)) > 1) return true;
  return false;
}

Paint ShaftPainter::paint_pixel(const Corners& at) {
  const Part low = *std::min_element(at.part.begin(), at.part.end());
  const Part high = *std::max_element(at.part.begin(), at.part.end());
  if (tracer_.has_gap() && is_band(high) && spans_seam(at)) return sampled(at);
  if (low == high && (on_side(low) || low == Part::tip)) return inside(at);
  const bool two_parts = std::all_of(at.part.begin(), at.part.end(), [&](Part p) { return p == low || p == high; });
  Paint paint;
  if (two_parts && low == Part::nothing && on_side(high) && silhouette(at, high, paint)) return paint;
  if (two_parts && is_band(low) && is_band(high) && boundary(at, low, high, paint)) return paint;
  return sampled(at);
}

Paint ShaftPainter::of_side(Part part, float azimuth_rad, float along_m) {
  const Lit lit = lighting_.on_side(azimuth_rad, along_m);
  return {reflectances_[static_cast<std::size_t>(part)] * lit.matt + Light::Constant(polish(part) * lit.gloss), 1};
}

const Light& ShaftPainter::reflectance(Part part, float along_m) const {
  if (part == Part::film_edge) part = along_m < 0.5F * tracer_.length_m() ? Part::band_0 : Part::band_2;
  return reflectances_[static_cast<std::size_t>(part)];
}

Lit ShaftPainter::lit_at(Part part, float x, float y, float depth_m) const {
  const Eigen::Vector3f point = tracer_.point_on_ray(x, y, depth_m);
  if (part == Part::tip) return lighting_.at(point, (point - tracer_.tip_centre()).normalized());
  return lighting_.at(point, {0, 0, point.z() < 0.5F * tracer_.length_m() ? -1.0F : 1.0F});
}

Paint ShaftPainter::inside(const Corners& at) {
  if (at.part[0] == Part::tip) {
    const Lit lit = lit_at(Part::tip, mean(at.x), mean(at.y), mean(at.depth_m));
    return {reflectance(Part::tip, mean(at.along_m)) * lit.matt + Light::Constant(lit.gloss), 1};
  }
  float azimuth_rad = mean(at.azimuth_rad);
  if (std::abs(azimuth_rad) > contour_rad) {
    single_.x[0] = mean(at.x);
    single_.y[0] = mean(at.y);
    tracer_.trace(single_, false);
    azimuth_rad = single_.azimuth_rad[0];
  }
  return of_side(at.part[0], azimuth_rad, mean(at.along_m));
}

bool ShaftPainter::silhouette(const Corners& at, Part inner, Paint& paint) {
  std::array<float, 4> outside;
  for (std::size_t i = 0; i < 4; ++i) {
    outside[i] = tracer_.outside_silhouette(at.x[i], at.y[i], inner);
    if ((outside[i] < 0) != (at.part[i] == inner)) return false;
  }
  const PixelCoverage covered = negative_part(outside);
  single_.x[0] = within(at.x, covered.centre_x, covered.centre_y);
  single_.y[0] = within(at.y, covered.centre_x, covered.centre_y);
  tracer_.trace(single_, false);
  if (single_.part[0] != inner) return false;
  paint = of_side(inner, single_.azimuth_rad[0], single_.along_m[0]);
  paint.light *= covered.fraction;
  paint.cover = covered.fraction;
  return true;
}

bool ShaftPainter::boundary(const Corners& at, Part proximal, Part distal, Paint& paint) {
  if (static_cast<int>(distal) != static_cast<int>(proximal) + 1) return false;
  std::array<float, 4> beyond_m;
  for (std::size_t i = 0; i < 4; ++i) {
    if (std::abs(at.azimuth_rad[i]) > flat_rad) return false;
    // Across the seam the boundary jumps.
    if (std::abs(tracer_.tau_rad(at.azimuth_rad[i]) - tracer_.tau_rad(at.azimuth_rad[0])) > 1) return false;
    beyond_m[i] = tracer_.beyond_boundary_m(static_cast<std::size_t>(proximal), at.azimuth_rad[i], at.along_m[i]);
    if ((beyond_m[i] < 0) != (at.part[i] == proximal)) return false;
  }
  const float fraction = negative_part(beyond_m).fraction;
  const float azimuth_rad = mean(at.azimuth_rad), along_m = mean(at.along_m);
  paint = {fraction * of_side(proximal, azimuth_rad, along_m).light +
               (1 - fraction) * of_side(distal, azimuth_rad, along_m).light,
           1};
  return true;
}

Paint ShaftPainter::sampled(const Corners& at) {
  const bool with_tip = std::find(at.part.begin(), at.part.end(), Part::tip) != at.part.end();
  for (std::size_t i = 0; i < sample_lattice.size(); ++i) {
    samples_.x[i] = within(at.x, sample_lattice[i][0], sample_lattice[i][1]);
    samples_.y[i] = within(at.y, sample_lattice[i][0], sample_lattice[i][1]);
  }
  tracer_.trace(samples_, with_tip);
  // The light falls on each surface within the pixel nearly evenly: worked out once for each.
  std::optional<Lit> on_tip, on_edge;
  Light side = Light::Zero(), other = Light::Zero();
  float side_count = 0, side_polish = 0, count = 0, azimuth_rad = 0, along_m = 0;
  for (std::size_t i = 0; i < sample_lattice.size(); ++i) {
    const Part part = samples_.part[i];
    if (part == Part::nothing) continue;
    ++count;
    const Light& light = reflectance(part, samples_.along_m[i]);
    if (on_side(part)) {
      ++side_count;
      side_polish += polish(part);
      azimuth_rad += samples_.azimuth_rad[i];
      along_m += samples_.along_m[i];
      side += light;
      continue;
    }
    std::optional<Lit>& lit = part == Part::tip ? on_tip : on_edge;
    if (!lit) lit = lit_at(part, samples_.x[i], samples_.y[i], samples_.depth_m[i]);
    other += light * lit->matt + Light::Constant(lit->gloss);
  }
  Paint paint;
  if (side_count > 0) {
    const Lit lit = lighting_.on_side(azimuth_rad / side_count, along_m / side_count);
    paint.light = side * lit.matt + Light::Constant(side_polish * lit.gloss);
  }
  paint.light = (paint.light + other) / sample_lattice.size();
  paint.cover = count / sample_lattice.size();
  return paint;
}

}  // namespace lapservo::internal
