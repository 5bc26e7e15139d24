#include "lapservo/vision/paper/centerline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/rig/registration_covariance.h"
#include "lapservo/vision/shaft/rcm_prior.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {
namespace {

// Sigmas of a boundary along the line, of the line across at an end, and of both ends outwards, where colours mix with
// the bare shaft's: measured 0.3 to 0.5, 0.5 and 1.3 with `lapservo render --rig configs/example.yaml --count 40`.
constexpr double boundary_sigma_px = 0.5, across_sigma_px = boundary_sigma_px, outwards_sigma_px = 1.3;
constexpr double widest_hue_deg = 30;
constexpr int min_saturation = 60, min_value = 40, min_area_px = 150;

using BandMasks = std::array<cv::Mat, 3>;
using Edges = std::array<Eigen::Vector2d, 4>;

cv::Mat hue_mask(const cv::Mat& hsv, double hue_deg, double reach_deg) {
  const auto in_range = [&](double low_deg, double high_deg) {
    cv::Mat mask;
    cv::inRange(hsv, cv::Scalar(low_deg / 2, min_saturation, min_value), cv::Scalar(high_deg / 2, 255, 255), mask);
    return mask;
  };
  constexpr double last_deg = whole_turn_deg - 1;
  const double low = hue_deg - reach_deg, high = hue_deg + reach_deg;
  cv::Mat mask = in_range(std::max(0.0, low), std::min(last_deg, high));
  if (low < 0) mask |= in_range(low + whole_turn_deg, last_deg);
  if (high > last_deg) mask |= in_range(0, high - whole_turn_deg);
  return mask;
}

cv::Mat ellipse(int size_px) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {size_px, size_px});
}

BandMasks segment(const cv::Mat& hsv, const Marker& marker) {
  double reach_deg = widest_hue_deg;
  for (std::size_t i = 0; i < 3; ++i)
    reach_deg = std::min(reach_deg, hue_gap_deg(marker.hues_deg[i], marker.hues_deg[(i + 1) % 3]) / 2);
  static const cv::Mat kernel = ellipse(5);
  BandMasks masks;
  for (std::size_t i = 0; i < 3; ++i) {
    const cv::Mat mask = hue_mask(hsv, marker.hues_deg[i], reach_deg);
    cv::morphologyEx(mask, masks[i], cv::MORPH_OPEN, kernel);
  }
  return masks;
}

struct Region {
  cv::Mat pixels;  // 255 inside
  cv::Rect box;
  int area_px;
};

// Connected regions of the three colours together, largest first.
std::vector<Region> regions_of(const BandMasks& masks) {
  cv::Mat together = masks[0] | masks[1] | masks[2], joined, labels, stats, centroids;
  cv::morphologyEx(together, joined, cv::MORPH_CLOSE, ellipse(9));
  const int count = cv::connectedComponentsWithStats(joined, labels, stats, centroids);
  std::vector<Region> regions;
  for (int i = 1; i < count; ++i) {
    const cv::Rect box(stats.at<int>(i, cv::CC_STAT_LEFT), stats.at<int>(i, cv::CC_STAT_TOP),
                       stats.at<int>(i, cv::CC_STAT_WIDTH), stats.at<int>(i, cv::CC_STAT_HEIGHT));
    const int area_px = stats.at<int>(i, cv::CC_STAT_AREA);
    if (area_px >= min_area_px) regions.push_back({labels == i, box, area_px});
  }
  std::sort(regions.begin(), regions.end(), [](const Region& a, const Region& b) { return a.area_px > b.area_px; });
  return regions;
}

// The axis' image (ideal pixels): the middle between the region's two sides, directed by the order of the colours.
using MiddleLine = Eigen::ParametrizedLine<double, 2>;
std::optional<MiddleLine> middle_line(const Camera& camera, const BandMasks& masks, const Region& region) {
  const auto centroid = [&](const cv::Moments& m) {
    return Eigen::Vector2d(region.box.x + m.m10 / m.m00, region.box.y + m.m01 / m.m00);
  };
  std::array<Eigen::Vector2d, 3> centres;
  for (std::size_t band = 0; band < 3; ++band) {
    const cv::Moments of_band = cv::moments(masks[band](region.box) & region.pixels(region.box), true);
    if (of_band.m00 < 20) return std::nullopt;
    centres[band] = centroid(of_band);
  }
  const cv::Moments m = cv::moments(region.pixels(region.box), true);
  const double turn = 0.5 * std::atan2(2 * m.mu11, m.mu20 - m.mu02);
  Eigen::Vector2d along(std::cos(turn), std::sin(turn));
  if (along.dot(centres[2] - centres[0]) < 0) along = -along;
  // The middle colour must lie in the middle: otherwise these are another instrument's bands.
  if (along.dot(centres[1] - centres[0]) <= 0 || along.dot(centres[2] - centres[1]) <= 0) return std::nullopt;

  std::vector<cv::Point> pixels;
  cv::findNonZero(region.pixels(region.box), pixels);
  const Eigen::Vector2d origin = centroid(m), across(-along.y(), along.x());
  struct Extent {
    double low = HUGE_VAL, high = -HUGE_VAL;
  };
  const int middle = camera.width_px + camera.height_px;  // of as many sections on either side
  std::vector<Extent> sections(static_cast<std::size_t>(2 * middle));
  double first = HUGE_VAL, last = -HUGE_VAL;
  for (const cv::Point& pixel : pixels) {
    const Eigen::Vector2d offset = Eigen::Vector2d(pixel.x + region.box.x, pixel.y + region.box.y) - origin;
    const double x = offset.dot(along);
    first = std::min(first, x), last = std::max(last, x);
    Extent& section = sections[static_cast<std::size_t>(x + middle)];
    section.low = std::min(section.low, offset.dot(across)), section.high = std::max(section.high, offset.dot(across));
  }
  const double widest = 0.15 * (last - first);  // the ends are round
  std::vector<cv::Point2f> low, high;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    const double x = static_cast<double>(i) - middle + 0.5;
    if (sections[i].low > sections[i].high || x < first + widest || x > last - widest) continue;
    const auto ideal = [&](double y) { return camera.ideal_from_raw(origin + x * along + y * across); };
    const auto a = ideal(sections[i].low), b = ideal(sections[i].high);
    if (!a || !b) continue;
    low.emplace_back(static_cast<float>(a->x()), static_cast<float>(a->y()));
    high.emplace_back(static_cast<float>(b->x()), static_cast<float>(b->y()));
  }
  if (low.size() < 8) return std::nullopt;
  cv::Vec4f low_line, high_line;
  constexpr double accurate_to = 0.01;  // px, and rad
  cv::fitLine(low, low_line, cv::DIST_HUBER, 0, accurate_to, accurate_to);
  cv::fitLine(high, high_line, cv::DIST_HUBER, 0, accurate_to, accurate_to);
  const auto direction = [&](const cv::Vec4f& line) {
    const Eigen::Vector2d d(line[0], line[1]);
    return d.dot(along) < 0 ? Eigen::Vector2d(-d) : d;
  };
  const Eigen::Vector2d middle_direction = (direction(low_line) + direction(high_line)).normalized();
  const Eigen::Vector2d middle_origin(0.5 * (low_line[2] + high_line[2]), 0.5 * (low_line[3] + high_line[3]));
  return MiddleLine{middle_origin, middle_direction};
}

std::optional<Edges> boundaries_on(const MiddleLine& line, const Camera& camera, const BandMasks& masks) {
  constexpr double step_px = 0.5;
  const int reach = 4 * std::max(camera.width_px, camera.height_px);
  std::array<double, 3> first, last;
  first.fill(HUGE_VAL), last.fill(-HUGE_VAL);
  for (int i = -reach; i <= reach; ++i) {
    const double x = i * step_px;
    const Eigen::Vector2d ideal = line.pointAt(x);
    if (!camera.contains(ideal, -0.25 * camera.width_px)) continue;
    const Eigen::Vector2d raw = camera.raw_from_ideal(ideal);
    const int u = static_cast<int>(std::lround(raw.x())), v = static_cast<int>(std::lround(raw.y()));
    if (u < 0 || v < 0 || u >= camera.width_px || v >= camera.height_px) continue;
    for (std::size_t band = 0; band < 3; ++band)
      if (masks[band].at<std::uint8_t>(v, u))
        first[band] = std::min(first[band], x), last[band] = std::max(last[band], x);
  }
  const std::array<double, 4> x{first[0], (last[0] + first[1]) / 2, (last[1] + first[2]) / 2, last[2]};
  for (std::size_t k = 0; k < 4; ++k)
    if (std::abs(x[k]) > reach || (k > 0 && !(x[k] > x[k - 1] + 1))) return std::nullopt;
  Edges edges;
  for (std::size_t k = 0; k < 4; ++k) edges[k] = line.pointAt(x[k]);
  return edges;
}

// theta, phi and rho from e0 and e3 on the facing generatrix, for a known tau: Gauss-Newton with numeric derivatives.
std::optional<JointVector> configuration_from(const Camera& camera, const Marker& marker, const Rigid3& camera_from_rcm,
                                              const Edges& edges, double tau_rad) {
  const double depth_m = camera.fx_px * marker.length_m() / std::max(1.0, (edges[3] - edges[0]).norm());
  auto start = configuration_through(camera_from_rcm, camera.ray_from_ideal(edges[0]) * depth_m);
  if (!start) return std::nullopt;
  Eigen::Vector3d x(start->theta_rad, start->phi_rad, start->rho_m);
  const auto line_at = [&](const Eigen::Vector3d& p) {  // for any psi: the ends don't depend on it
    return centre_line(camera, marker, camera_from_rcm * rcm_from_unrolled({p[0], p[1], p[2], 0}), 0);
  };
  const auto seen = [&](const Eigen::Vector3d& p) -> std::optional<Eigen::Vector4d> {
    const auto line = line_at(p);
    if (!line) return std::nullopt;
    return Eigen::Vector4d(line->ideal_px[0].x(), line->ideal_px[0].y(), line->ideal_px[3].x(), line->ideal_px[3].y());
  };
  const Eigen::Vector4d measured(edges[0].x(), edges[0].y(), edges[3].x(), edges[3].y());
  double miss_px = HUGE_VAL;
  for (int iteration = 0; iteration < 15; ++iteration) {
    const auto at = seen(x);
    if (!at) return std::nullopt;
    miss_px = (measured - *at).norm();
    Eigen::Matrix<double, 4, 3> jacobian;
    for (int i = 0; i < 3; ++i) {
      const auto ahead = seen(x + derivative_step * Eigen::Vector3d::Unit(i));
      if (!ahead) return std::nullopt;
      jacobian.col(i) = (*ahead - *at) / derivative_step;
    }
    Eigen::Matrix3d normal = jacobian.transpose() * jacobian;
    normal.diagonal() *= 1 + 1e-6;
    const Eigen::Vector3d step = normal.ldlt().solve(jacobian.transpose() * (measured - *at));
    if (!step.allFinite()) return std::nullopt;
    constexpr double longest_rad = 0.2;
    const Eigen::Vector3d longest(longest_rad, longest_rad, 0.02);
    x += step.cwiseMax(-longest).cwiseMin(longest);
  }
  if (miss_px > 10) return std::nullopt;  // no shaft through the RCM looks like this
  const auto line = line_at(x);
  if (!line) return std::nullopt;
  return JointVector{wrap_pi(x[0]), x[1], x[2], wrap_pi(rotation_rad(marker, line->facing_azimuth_rad, tau_rad))};
}

using EdgesVector = Eigen::Matrix<double, 8, 1>;

// Uncertainties of the boundaries, one sigma each: each errs along the line by itself, by `along_px`, both ends
// together; all turn and shift across with the line's ends.
std::array<EdgesVector, 7> errors_of(const Edges& edges, double along_px) {
  const double length_px = (edges[3] - edges[0]).norm();
  const Eigen::Vector2d along = (edges[3] - edges[0]) / length_px, across(-along.y(), along.x());
  std::array<EdgesVector, 7> errors;
  errors.fill(EdgesVector::Zero());
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Index place = 2 * static_cast<Eigen::Index>(k);
    const double fraction = (edges[k] - edges[0]).norm() / length_px;
    errors[k].segment<2>(place) = along_px * along;
    errors[4].segment<2>(place) = (1 - fraction) * across_sigma_px * across;
    errors[5].segment<2>(place) = fraction * across_sigma_px * across;
  }
  errors[6].head<2>() = -outwards_sigma_px * along, errors[6].tail<2>() = outwards_sigma_px * along;
  return errors;
}

Edges moved(Edges edges, const EdgesVector& error) {
  for (std::size_t k = 0; k < 4; ++k) edges[k] += error.segment<2>(2 * static_cast<Eigen::Index>(k));
  return edges;
}

// Status::ok, or what is refused of the edges.
Observation observe_edges(const Camera& camera, const Instrument& instrument, const CrossRatioDecoder& decoder,
                          const Edges& edges) {
  Observation o, refused;
  o.status = Status::ok, refused.status = Status::poor_fit;
  refused.refused.what = Observation::Refused::What::edges;
  o.edges_ideal_px = edges;
  for (const EdgesVector& error : errors_of(edges, boundary_sigma_px))
    o.edges_covariance_px2 += error * error.transpose();
  for (std::size_t k = 0; k < 4; ++k)
    o.edges_raw_px[k] = refused.refused.edges_raw_px[k] = camera.raw_from_ideal(edges[k]);
  const Marker& marker = instrument.marker;
  const auto& camera_from_rcm = instrument.camera_from_rcm;
  o.features = features_of(edges, camera_from_rcm ? projected_rcm_px(camera, *camera_from_rcm) : std::nullopt);
  const double room = 0.1 * (decoder.highest_cross_ratio() - decoder.lowest_cross_ratio());
  if (o.features.cross_ratio < decoder.lowest_cross_ratio() - room ||
      o.features.cross_ratio > decoder.highest_cross_ratio() + room)
    return refused;
  o.tau_rad = decoder.tau_rad(o.features.cross_ratio);
  const double print_px = marker.boundary_sigma_m() * o.features.l_px / marker.length_m();
  const auto errors = errors_of(edges, std::hypot(boundary_sigma_px, print_px));
  const auto ratio_of = [](const Edges& e) { return features_of(e, std::nullopt).cross_ratio; };
  // At the ends of its range tau is clamped and its derivative lost: there the mean slope over the turn stands in.
  double tau_variance = 0, ratio_variance = 0;
  for (const EdgesVector& error : errors) {
    const double ratio = ratio_of(moved(edges, error));
    tau_variance += std::pow(decoder.tau_rad(ratio) - o.tau_rad, 2);
    ratio_variance += std::pow(ratio - o.features.cross_ratio, 2);
  }
  const double mean_slope = two_pi / (decoder.highest_cross_ratio() - decoder.lowest_cross_ratio());
  o.sigma_tau_rad = std::sqrt(std::max(tau_variance, mean_slope * mean_slope * ratio_variance));
  if (!camera_from_rcm) {
    const double depth_m = camera.fx_px * marker.length_m() / o.features.l_px;
    const Eigen::Vector3d from = camera.ray_from_ideal(edges[0]) * depth_m,
                          to = camera.ray_from_ideal(edges[3]) * depth_m;
    o.camera_from_unrolled = {rotation_between(Eigen::Vector3d::UnitZ(), to - from), from};
    return o;
  }
  const auto q = configuration_from(camera, marker, *camera_from_rcm, edges, o.tau_rad);
  if (!q) return refused;
  Observation::Rcm rcm{*q, Eigen::Matrix4d::Zero()};
  for (const EdgesVector& error : errors) {
    const Edges changed = moved(edges, error);
    const double tau_rad = decoder.tau_rad(ratio_of(changed));
    const auto other = configuration_from(camera, marker, *camera_from_rcm, changed, tau_rad);
    if (!other) return refused;
    const Eigen::Vector4d change = configuration_change(*q, *other);
    rcm.covariance += change * change.transpose();
  }
  const Eigen::Matrix<double, 4, 6> slopes = by_registration(*camera_from_rcm, *q, [&](const Rigid3& changed) {
    return configuration_from(camera, marker, changed, edges, o.tau_rad);
  });
  rcm.covariance += slopes * registration_covariance(instrument) * slopes.transpose();
  const double sigma_seam_rad = marker.sigmas.seam_rad.value_or(0);
  rcm.covariance(3, 3) =
      std::max(rcm.covariance(3, 3), o.sigma_tau_rad * o.sigma_tau_rad) + sigma_seam_rad * sigma_seam_rad;
  rcm.covariance.diagonal().array() += derivative_step * derivative_step;
  o.rcm = rcm;
  o.camera_from_unrolled = *camera_from_rcm * rcm_from_unrolled(*q);
  o.psi_rad = q->psi_rad;
  return o;
}

}  // namespace

CenterlineMethod::CenterlineMethod(const Rig& rig) : rig_(rig) {
  for (const Instrument& instrument : rig.instruments) decoders_.emplace_back(instrument.marker);
}

std::vector<Observation> CenterlineMethod::observe(const cv::Mat& image_bgr) const {
  cv::Mat hsv;
  cv::cvtColor(image_bgr, hsv, cv::COLOR_BGR2HSV);
  std::vector<Observation> observations(rig_.instruments.size());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const BandMasks masks = segment(hsv, rig_.instruments[i].marker);
    for (const Region& region : regions_of(masks)) {
      const auto line = middle_line(rig_.camera, masks, region);
      if (!line) continue;
      BandMasks inside;
      for (std::size_t band = 0; band < 3; ++band) inside[band] = masks[band] & region.pixels;
      const auto edges = boundaries_on(*line, rig_.camera, inside);
      observations[i].status = Status::poor_fit;
      if (edges) observations[i] = observe_edges(rig_.camera, rig_.instruments[i], decoders_[i], *edges);
      if (observations[i].status == Status::ok) break;
    }
  }
  return observations;
}

}  // namespace lapservo::internal
