#include "lapservo/sim/tool_painter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/sim/shaft_lighting.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

constexpr double nearest_m = 1e-3, shortest_m = 1e-6;
constexpr float metal = 0.3F, metal_gloss = 2;

// How far along a ray from the camera (z = 1) its surface is met first.
std::optional<double> depth_on_ball(const Eigen::Vector3d& centre_m, double radius_m, const Eigen::Vector3d& ray) {
  const double a = ray.squaredNorm(), b = ray.dot(centre_m);
  const double root2 = b * b - a * (centre_m.squaredNorm() - radius_m * radius_m);
  if (!(root2 > 0)) return std::nullopt;
  return (b - std::sqrt(root2)) / a;
}

std::optional<double> depth_on(const Capsule& link, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d axis = link.to_m - link.from_m;
  const double length2 = axis.squaredNorm(), along = axis.dot(ray), start = -axis.dot(link.from_m);
  // Across the axis, times its length.
  const double a = length2 * ray.squaredNorm() - along * along;
  const double b = -length2 * ray.dot(link.from_m) - start * along;
  const double c = length2 * link.from_m.squaredNorm() - start * start - link.radius_m * link.radius_m * length2;
  const double root2 = b * b - a * c;
  if (a > 1e-12 * length2) {
    if (!(root2 > 0)) return std::nullopt;
    const double depth_m = (-b - std::sqrt(root2)) / a, at = start + depth_m * along;
    if (at > 0 && at < length2) return depth_m;
  }
  const auto first = depth_on_ball(link.from_m, link.radius_m, ray),
             last = depth_on_ball(link.to_m, link.radius_m, ray);
  return first && last ? std::min(*first, *last) : first ? first : last;
}

// Its surface, not its axis, ends at the tip.
Capsule link_to_tip(const Eigen::Vector3d& from_m, const Eigen::Vector3d& tip_m, double radius_m) {
  const Eigen::Vector3d step_m = tip_m - from_m;
  const double length_m = step_m.norm();
  return {from_m, from_m + std::max(0.0, 1 - radius_m / std::max(length_m, shortest_m)) * step_m, radius_m};
}

}  // namespace

std::vector<Capsule> tool_links(const ShaftModel& model, const ShaftPlacement& placement) {
  if (!model.tool || !model.tool->place) return {};
  const Tool& tool = *model.tool;
  const std::vector<double> wrist_rad =
      placement.wrist_rad.empty() ? std::vector<double>(tool.wrist.size(), 0) : placement.wrist_rad;
  const Rigid3 from_marker = camera_from_marker(model.marker, placement.camera_from_unrolled, placement.psi_rad);
  const auto frames = joints_in_marker(tool, wrist_rad);
  const std::size_t count = tool.wrist.size();
  const Eigen::Vector3d tip_m = from_marker * (frames[count] * tool.last_from_tip.translation);
  const double radius_m = model.marker.radius_m();
  const Eigen::Vector3d shaft_end(0, 0, model.marker.length_m() + model.shaft_beyond_m);
  Eigen::Vector3d from_m = from_marker * shaft_end;
  if (count == 0) return {link_to_tip(from_m, tip_m, 0.4 * radius_m)};

  std::vector<Capsule> links;
  for (std::size_t i = 0; i <= count; ++i) {
    const Eigen::Vector3d to_m = from_marker * frames[i].translation;
    if ((to_m - from_m).norm() > shortest_m) links.push_back({from_m, to_m, 0.65 * radius_m});
    from_m = to_m;
  }
  const Eigen::Vector3d axis = from_marker.rotation * (frames[count].rotation * Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d aside_m = 0.4 * radius_m * axis.cross(tip_m - from_m).normalized();
  for (const double side : {-1.0, 1.0}) links.push_back(link_to_tip(from_m + side * aside_m, tip_m, 0.25 * radius_m));
  return links;
}

ToolPainter::ToolPainter(std::vector<Capsule> links, const Lighting& lighting)
    : links_(std::move(links)), lighting_(lighting) {
  for (std::size_t i = 0; i < lamps_.size(); ++i) lamps_[i] = lighting.lamps_in_camera_m[i].cast<float>();
}

ToolPainter::Hit ToolPainter::trace(float x, float y) const {
  Hit nearest;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const auto depth_m = depth_on(links_[i], {x, y, 1});
    if (!depth_m || *depth_m < nearest_m || (nearest.link >= 0 && *depth_m >= nearest.depth_m)) continue;
    nearest = {static_cast<int>(i), static_cast<float>(*depth_m)};
  }
  return nearest;
}

Light ToolPainter::light_from(const Hit& hit, float x, float y) const {
  const Capsule& link = links_[static_cast<std::size_t>(hit.link)];
  const Eigen::Vector3d point = hit.depth_m * Eigen::Vector3d(x, y, 1), axis = link.to_m - link.from_m;
  const double along = axis.dot(point - link.from_m) / std::max(axis.squaredNorm(), shortest_m * shortest_m);
  const Eigen::Vector3d normal = (point - link.from_m - std::clamp(along, 0.0, 1.0) * axis).normalized();
  const Lit lit = light_at(lighting_, lamps_, Eigen::Vector3f::Zero(), point.cast<float>(), normal.cast<float>());
  return Light::Constant(metal * lit.matt + metal_gloss * lit.gloss);
}

Paint ToolPainter::paint_pixel(const std::array<Hit, 4>& hits, const std::array<float, 4>& x,
                               const std::array<float, 4>& y, float& depth_m) const {
  Paint paint;
  const auto add = [&](float u, float v, float weight) {
    const float ray_x = within(x, u, v), ray_y = within(y, u, v);
    const Hit hit = trace(ray_x, ray_y);
    if (hit.link < 0) return;
    paint.light += weight * light_from(hit, ray_x, ray_y);
    paint.cover += weight;
    depth_m = std::min(depth_m, hit.depth_m);
  };
  const bool whole = std::all_of(hits.begin(), hits.end(), [&](const Hit& hit) { return hit.link == hits[0].link; });
  if (whole) {
    add(0.5F, 0.5F, 1);
  } else {
    for (const auto& place : sample_lattice) add(place[0], place[1], 1.0F / sample_lattice.size());
  }
  return paint;
}

void ToolPainter::paint(const PixelRays& rays, const cv::Rect& part, const cv::Mat& behind, SceneLight& scene) const {
  const auto width = static_cast<std::size_t>(part.width);
  RayRow above, below;
  above.resize(width + 1), below.resize(width + 1);
  std::vector<Hit> hits_above(width + 1), hits_below(width + 1);
  const auto fill = [&](int v) {
    rays.fill(below, part.x, v);
    for (std::size_t i = 0; i <= width; ++i) hits_below[i] = trace(below.x[i], below.y[i]);
  };
  fill(part.y);
  for (int v = part.y; v < part.y + part.height; ++v) {
    std::swap(above, below), std::swap(hits_above, hits_below);
    fill(v + 1);
    for (std::size_t i = 0; i < width; ++i) {
      const std::array hits{hits_above[i], hits_above[i + 1], hits_below[i + 1], hits_below[i]};
      if (std::all_of(hits.begin(), hits.end(), [](const Hit& hit) { return hit.link < 0; })) continue;
      float depth_m = 1e9F;
      const Paint paint = paint_pixel(hits, {above.x[i], above.x[i + 1], below.x[i + 1], below.x[i]},
                                      {above.y[i], above.y[i + 1], below.y[i + 1], below.y[i]}, depth_m);
      const int u = part.x + static_cast<int>(i);
      blend(paint, depth_m, behind.at<cv::Vec3f>(v, u), scene.light.at<cv::Vec3f>(v, u), scene.depth_m.at<float>(v, u),
            scene.cover.at<float>(v, u));
    }
  }
}

}  // namespace lapservo::internal
