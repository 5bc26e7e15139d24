#include "lapservo/sim/shaft_tracer.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/angles.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {
namespace {

constexpr float nearest_m = 1e-3F;
constexpr float full_turn = static_cast<float>(two_pi);

// Arc tangent of |x| <= 1 to 2e-7: minimax polynomial, free of branches and library calls so that loops vectorise.
inline float arc_tangent(float x) {
  const float s = x * x;
  return x * (0.999999911F +
              s * (-0.333320935F +
                   s * (0.19971375F +
                        s * (-0.140294192F +
                             s * (0.0994275745F + s * (-0.0599046919F + s * (0.0245571074F + s * -0.00478045053F)))))));
}

}  // namespace

void RayRow::resize(std::size_t count) {
  for (auto* column : {&x, &y, &azimuth_rad, &along_m, &depth_m}) column->resize(count);
  part.resize(count);
}

ShaftTracer::ShaftTracer(const ShaftModel& model, const ShaftPlacement& placement)
    : blotches_(model.blotches), cells_(model.cells) {
  const Marker& marker = model.marker;
  const Rigid3 unrolled_from_camera = placement.camera_from_unrolled.inverse();
  const Eigen::Vector3d camera = unrolled_from_camera.translation;
  const double facing_rad = std::atan2(camera.y(), camera.x());
  const Rigid3 facing_from_unrolled{Eigen::Quaterniond(Eigen::AngleAxisd(-facing_rad, Eigen::Vector3d::UnitZ())),
                                    Eigen::Vector3d::Zero()};
  facing_from_camera_ = facing_from_unrolled * unrolled_from_camera;
  rotation_ = facing_from_camera_.rotation.toRotationMatrix().cast<float>();
  camera_ = Eigen::Vector3d(camera.head<2>().norm(), 0, camera.z()).cast<float>();
  outer_m_ = static_cast<float>(marker.radius_m());
  inner_m_ = static_cast<float>(marker.radius_m() - model.film_m);
  tip_m_ = static_cast<float>(model.tip_radius_m());
  length_m_ = static_cast<float>(marker.length_m());
  shaft_start_m_ = static_cast<float>(-model.shaft_before_m);
  shaft_end_m_ = static_cast<float>(marker.length_m() + model.shaft_beyond_m);
  tau_facing_ = static_cast<float>(wrap_two_pi(marker_azimuth_rad(marker, facing_rad, placement.psi_rad)));
  const auto at_seam = boundaries_m(marker, 0), slopes = boundary_slopes_m(marker);
  for (std::size_t i = 0; i < 4; ++i) {
    at_seam_m_[i] = static_cast<float>(at_seam[i]);
    slope_m_[i] = static_cast<float>(slopes[i]);
  }
  covered_rad_ = static_cast<float>(marker.covered_rad());
  for (Blotch& blotch : blotches_) blotch.azimuth_rad = wrap_two_pi(blotch.azimuth_rad);
  square_ = marker.gap_rad == 0 && slopes[0] == 0 && slopes[3] == 0;
  visible_ = camera_.x() > 1.01F * outer_m_;
}

void ShaftTracer::trace(RayRow& rays, bool with_tip) const {
  square_ ? trace_square(rays) : trace_askew(rays);
  if (with_tip) trace_tip(rays);
  if (cells_.rows > 0) print(rays);
  if (!blotches_.empty()) stain(rays);
}

// A ray goes onto the film, or past it onto the shaft; where the film covers that place it went in through an edge.
void ShaftTracer::trace_askew(RayRow& rays) const {
  const float cx = camera_.x(), cz = camera_.z();
  struct Hit {
    bool met = false;
    float depth_m = 0, along_m = 0, azimuth_rad = 0;
    int band = 0;  // of the film over it; 0 where there is none
  };
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3f d = rotation_ * Eigen::Vector3f(rays.x[i], rays.y[i], 1);
    const float a = d.x() * d.x() + d.y() * d.y(), cross2 = cx * cx * d.y() * d.y(), closest = -cx * d.x();
    // `side`: -1 where the ray comes in, 1 where it leaves.
    const auto hit = [&](float radius_m, float side) {
      Hit at;
      const float root2 = radius_m * radius_m * a - cross2;
      at.depth_m = (closest + side * std::sqrt(std::max(root2, 0.0F))) / a;
      at.met = root2 > 0 && at.depth_m > nearest_m;
      at.along_m = cz + at.depth_m * d.z();
      at.azimuth_rad = std::atan2(at.depth_m * d.y(), cx + at.depth_m * d.x());
      const float tau = tau_rad(at.azimuth_rad);
      const bool covered =
          tau < covered_rad_ && at.along_m >= slope_m_[0] * tau && at.along_m <= length_m_ + slope_m_[3] * tau;
      if (covered)
        at.band =
            1 + (at.along_m > at_seam_m_[1] + slope_m_[1] * tau) + (at.along_m > at_seam_m_[2] + slope_m_[2] * tau);
      return at;
    };
    const Hit outer = hit(outer_m_, -1);
    Hit seen = outer;
    Part part = outer.met && outer.band > 0 ? static_cast<Part>(outer.band) : Part::nothing;
    if (part == Part::nothing && outer.met) {
      const Hit inner = hit(inner_m_, -1), leaving = inner.met ? inner : hit(outer_m_, 1);
      seen = inner.met ? inner : outer;
      if (leaving.band > 0)
        part = Part::film_edge;
      else if (inner.met && inner.along_m > shaft_start_m_ && inner.along_m < shaft_end_m_)
        part = Part::shaft;
    }
    rays.azimuth_rad[i] = seen.azimuth_rad;
    rays.along_m[i] = seen.along_m;
    rays.depth_m[i] = seen.depth_m;
    rays.part[i] = part;
  }
}

void ShaftTracer::trace_square(RayRow& rays) const {
  const Eigen::Matrix3f& m = rotation_;
  const float cx = camera_.x(), cz = camera_.z();
  const float outer2 = outer_m_ * outer_m_, inner2 = inner_m_ * inner_m_;
  const float* ray_x = rays.x.data();
  const float* ray_y = rays.y.data();
  float* azimuths = rays.azimuth_rad.data();
  float* alongs = rays.along_m.data();
  float* depths = rays.depth_m.data();
  Part* parts = rays.part.data();
  const std::size_t count = rays.size();
  const float m00 = m(0, 0), m01 = m(0, 1), m02 = m(0, 2), m10 = m(1, 0), m11 = m(1, 1), m12 = m(1, 2), m20 = m(2, 0),
              m21 = m(2, 1), m22 = m(2, 2);
  const float length = length_m_, start = shaft_start_m_, end = shaft_end_m_, tau_facing = tau_facing_;
  const float e1 = at_seam_m_[1], e2 = at_seam_m_[2], e1_slope = slope_m_[1], e2_slope = slope_m_[2];
  const float per_outer = 1 / outer_m_, per_inner = 1 / inner_m_;
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC ivdep  // the columns never overlap
#endif
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = m00 * ray_x[i] + m01 * ray_y[i] + m02;
    const float dy = m10 * ray_x[i] + m11 * ray_y[i] + m12;
    const float dz = m20 * ray_x[i] + m21 * ray_y[i] + m22;
    // The camera lies at (cx, 0, cz): |d x c| = cx |dy|, without the cancellation of b^2 - a c.
    const float a = dx * dx + dy * dy, cross2 = cx * cx * dy * dy;
    const float per_a = 1 / a, closest = -cx * dx;
    const float outer_root2 = outer2 * a - cross2, inner_root2 = inner2 * a - cross2;
    const float outer_root = std::sqrt(std::max(outer_root2, 0.0F)),
                inner_root = std::sqrt(std::max(inner_root2, 0.0F));
    const float outer_depth = (closest - outer_root) * per_a, inner_depth = (closest - inner_root) * per_a;
    const float outer_along = cz + outer_depth * dz, inner_along = cz + inner_depth * dz;
    const int meets_outer = (outer_root2 > 0) & (outer_depth > nearest_m);
    const int meets_inner = (inner_root2 > 0) & (inner_depth > nearest_m);
    const int on_film = meets_outer & (outer_along >= 0) & (outer_along <= length);
    // Through an end face of the film: in at one side of its plane, at the shaft (or out again) on the other.
    const float leaving = inner_root2 > 0 ? inner_along : cz + (closest + outer_root) * per_a * dz;
    const int through_end =
        meets_outer & (((outer_along > length) & (leaving < length)) | ((outer_along < 0) & (leaving > 0)));
    const int on_shaft = meets_inner & (inner_along > start) & (inner_along < end);

    const float depth = on_film ? outer_depth : inner_depth;
    const float per_radius = on_film ? per_outer : per_inner;
    const float along = cz + depth * dz;
    const float cosine = (cx + depth * dx) * per_radius, sine = depth * dy * per_radius;
    const float azimuth = 2 * arc_tangent(std::min(1.0F, std::max(-1.0F, sine / (1 + std::max(cosine, 0.0F)))));
    float tau = tau_facing + azimuth;
    tau += tau < 0 ? full_turn : 0.0F;
    tau -= tau >= full_turn ? full_turn : 0.0F;
    const int band = 1 + (along > e1 + e1_slope * tau) + (along > e2 + e2_slope * tau);
    constexpr int shaft = static_cast<int>(Part::shaft), film_edge = static_cast<int>(Part::film_edge);
    const int part = on_film ? band : (through_end ? film_edge : (on_shaft ? shaft : 0));
    azimuths[i] = azimuth;
    alongs[i] = along;
    depths[i] = depth;
    parts[i] = static_cast<Part>(part);
  }
}

void ShaftTracer::trace_tip(RayRow& rays) const {
  const Eigen::Vector3f from = camera_ - tip_centre();
  const float c = from.squaredNorm() - tip_m_ * tip_m_;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Eigen::Vector3f ray = rotation_ * Eigen::Vector3f(rays.x[i], rays.y[i], 1);
    const float a = ray.squaredNorm(), b = from.dot(ray), root2 = b * b - a * c;
    if (!(root2 > 0)) continue;
    const float depth_m = (-b - std::sqrt(root2)) / a;
    if (depth_m < nearest_m || (rays.part[i] != Part::nothing && rays.depth_m[i] < depth_m)) continue;
    rays.part[i] = Part::tip;
    rays.depth_m[i] = depth_m;
  }
}

void ShaftTracer::print(RayRow& rays) const {
  const auto cell = [](float place, float whole, int count) {
    return std::clamp(static_cast<int>(place / whole * static_cast<float>(count)), 0, count - 1);
  };
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!is_band(rays.part[i])) continue;
    const int row = cell(tau_rad(rays.azimuth_rad[i]), full_turn, cells_.rows);
    const int column = cell(rays.along_m[i], length_m_, cells_.columns);
    rays.part[i] = cells_.dark[static_cast<std::size_t>(row * cells_.columns + column)] ? Part::band_2 : Part::band_0;
  }
}

void ShaftTracer::stain(RayRow& rays) const {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!is_band(rays.part[i])) continue;
    const double tau = tau_rad(rays.azimuth_rad[i]);
    for (const Blotch& blotch : blotches_) {
      const double beside_m = rays.along_m[i] - blotch.along_m;
      if (std::abs(beside_m) > blotch.radius_m) continue;
      const double turn_rad = std::abs(tau - blotch.azimuth_rad);  // of two in [0, 2 pi]
      const double around_m = std::min(turn_rad, two_pi - turn_rad) * outer_m_;
      if (around_m * around_m + beside_m * beside_m >= blotch.radius_m * blotch.radius_m) continue;
      rays.part[i] = Part::blood;
      break;
    }
  }
}

float ShaftTracer::outside_silhouette(float x, float y, Part part) const {
  const Eigen::Vector3f ray = rotation_ * Eigen::Vector3f(x, y, 1);
  const float radius_m = is_band(part) || part == Part::blood ? outer_m_ : inner_m_;
  return camera_.x() * std::abs(ray.y()) - radius_m * ray.head<2>().norm();
}

float ShaftTracer::tau_rad(float azimuth_rad) const {
  float tau = tau_facing_ + azimuth_rad;
  if (tau < 0) tau += full_turn;
  return tau >= full_turn ? tau - full_turn : tau;
}

float ShaftTracer::beyond_boundary_m(std::size_t index, float azimuth_rad, float along_m) const {
  const float tau = tau_rad(azimuth_rad);
  return along_m - (at_seam_m_[index] + slope_m_[index] * tau);
}

Eigen::Vector3f ShaftTracer::in_facing_frame(const Eigen::Vector3d& point_in_camera) const {
  return (facing_from_camera_ * point_in_camera).cast<float>();
}

Eigen::Vector3f ShaftTracer::point_on_ray(float x, float y, float depth_m) const {
  return camera_ + depth_m * (rotation_ * Eigen::Vector3f(x, y, 1));
}

}  // namespace lapservo::internal
