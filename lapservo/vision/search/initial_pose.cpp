#include "lapservo/vision/search/initial_pose.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Eigenvalues>

#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/marker/band_shares.h"
#include "lapservo/vision/colour/colour_evidence.h"
#include "lapservo/vision/search/coarse_fit.h"
#include "lapservo/vision/search/heaviest_stretch.h"
#include "lapservo/vision/search/line_segmentation.h"

namespace lapservo::internal {
namespace {

// The shaft in the ideal image: x along its axis from `origin` (towards the tip), y across.
struct ImageFrame {
  Eigen::Vector2d origin, along;
  Eigen::Vector2d across() const { return {-along.y(), along.x()}; }
  Eigen::Vector2d at(double x, double y) const { return origin + x * along + y * across(); }
};

// y = offset + slope x, robustly.
struct SideLine {
  double offset = 0, slope = 0;
  double at(double x) const { return offset + slope * x; }
};

struct Outline {
  ImageFrame frame;
  SideLine low, high;      // the sides, low.at(x) < high.at(x)
  double first_x, last_x;  // extent of the blob
};

struct BlobShape {
  std::vector<Eigen::Vector2d> ideal_px;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  std::array<Eigen::Vector2d, 3> band_centres;
  std::array<int, 3> band_samples{};
  Eigen::Vector2d main_direction;
};

std::optional<BlobShape> shape_of(const Scene& scene, const Blob& blob) {
  BlobShape shape;
  shape.band_centres.fill(Eigen::Vector2d::Zero());
  for (const Blob::Sample& sample : blob.samples) {
    const auto band = std::find(scene.bands.begin(), scene.bands.end(), sample.colour);
    const auto ideal = scene.camera.ideal_from_raw(Eigen::Vector2d(sample.u, sample.v));
    if (band == scene.bands.end() || !ideal) continue;
    const auto index = static_cast<std::size_t>(band - scene.bands.begin());
    shape.ideal_px.push_back(*ideal);
    shape.centre += *ideal;
    shape.band_centres[index] += *ideal;
    ++shape.band_samples[index];
  }
  constexpr int min_of_a_band = 2;
  if (std::count_if(shape.band_samples.begin(), shape.band_samples.end(), [](int n) { return n >= min_of_a_band; }) <
          2 ||
      shape.band_samples[1] < min_of_a_band)
    return std::nullopt;
  shape.centre /= static_cast<double>(shape.ideal_px.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const Eigen::Vector2d& p : shape.ideal_px) scatter += (p - shape.centre) * (p - shape.centre).transpose();
  shape.main_direction = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(scatter).eigenvectors().col(1);
  for (std::size_t i = 0; i < 3; ++i)
    if (shape.band_samples[i]) shape.band_centres[i] /= shape.band_samples[i];
  return shape;
}

// Proximal to distal along a given line, by the order of the colours; nullopt when they contradict it.
std::optional<Eigen::Vector2d> directed(const BlobShape& shape, Eigen::Vector2d line) {
  const auto x = [&](std::size_t band) { return line.dot(shape.band_centres[band]); };
  double forward = 0, backward = 0;
  for (std::size_t band = 0; band < 2; ++band) {
    if (shape.band_samples[band] < 2 || shape.band_samples[band + 1] < 2) continue;
    (x(band + 1) > x(band) ? forward : backward) += 1;
  }
  if (forward == backward) return std::nullopt;
  return forward > backward ? line : Eigen::Vector2d(-line);
}

// `outwards`: +1 or -1, where the shaft ends. Blood hides parts of a side but adds none: points inside the line weigh
// less.
SideLine fit_side(const std::vector<Eigen::Vector2d>& points, double outwards) {
  SideLine line;
  double scale = 1e9;
  for (int round = 0; round < 6; ++round) {
    double w = 0, wx = 0, wy = 0, wxx = 0, wxy = 0;
    std::vector<double> misses;
    for (const Eigen::Vector2d& p : points) {
      const double miss = p.y() - line.at(p.x());
      const double x = outwards * miss > 0 ? miss / (2 * scale) : miss / (0.5 * scale);
      const double weight = round == 0 ? 1 : 1 / (1 + x * x);
      w += weight, wx += weight * p.x(), wy += weight * p.y();
      wxx += weight * p.x() * p.x(), wxy += weight * p.x() * p.y();
    }
    const double spread = w * wxx - wx * wx;
    line.slope = spread > 1e-9 ? (w * wxy - wx * wy) / spread : 0;
    line.offset = (wy - line.slope * wx) / w;
    for (const Eigen::Vector2d& p : points) misses.push_back(std::abs(p.y() - line.at(p.x())));
    scale = std::max(1.0, 2 * median(misses));
  }
  return line;
}

// Where the marker's colours begin and end on a section at x; nullopt where few are, or the image ends beside them.
struct Section {
  double low, high;
};
std::optional<Section> section_at(const Scene& scene, const ImageFrame& frame, double x, double reach_px,
                                  double step_px) {
  const int reach = static_cast<int>(reach_px / step_px);
  const auto colour_at = [&](int i) { return scene.class_at(scene.camera.raw_from_ideal(frame.at(x, i * step_px))); };
  const Stretch<double> coloured =
      heaviest_stretch(-reach, reach + 1, [&](int i) { return section_gain(scene.is_ours(colour_at(i))); });
  if (coloured.sum * step_px < 4) return std::nullopt;
  if (colour_at(coloured.first - 1) == Scene::outside || colour_at(coloured.last + 1) == Scene::outside)
    return std::nullopt;
  return Section{(coloured.first - 0.5) * step_px - coarse_fit_limits.contour_inset_px,
                 (coloured.last + 0.5) * step_px + coarse_fit_limits.contour_inset_px};
}

// Points on the sides, in the outline's frame.
struct OutlineSides {
  std::vector<Eigen::Vector2d> low, high;
};

// The blob's extent along the shaft, and sections across it, as wide as it is. Round 0 and 1 only turn and shift the
// frame.
std::optional<OutlineSides> find_sides(const Scene& scene, const BlobShape& shape, Outline& outline, bool last_round) {
  constexpr int sections = 13;
  constexpr std::size_t enough = 4;
  double widest = 0;
  outline.first_x = outline.last_x = 0;
  for (const Eigen::Vector2d& p : shape.ideal_px) {
    const Eigen::Vector2d offset = p - outline.frame.origin;
    outline.first_x = std::min(outline.first_x, offset.dot(outline.frame.along));
    outline.last_x = std::max(outline.last_x, offset.dot(outline.frame.along));
    widest = std::max(widest, std::abs(offset.dot(outline.frame.across())));
  }
  const double reach_px = widest * 1.3 + 12, finest_px = std::max(1.0, reach_px / 150);
  const double step_px = last_round ? finest_px : std::max(finest_px, reach_px / 40);
  OutlineSides sides;
  for (int i = 0; i < sections; ++i) {
    const double x = outline.first_x + (outline.last_x - outline.first_x) * (i + 0.5) / sections;
    const auto section = section_at(scene, outline.frame, x, reach_px, step_px);
    if (!section) continue;
    sides.low.emplace_back(x, section->low), sides.high.emplace_back(x, section->high);
  }
  return sides.low.size() >= enough ? std::optional(sides) : std::nullopt;
}

std::optional<Outline> find_outline(const Scene& scene, const BlobShape& shape, Eigen::Vector2d along) {
  Outline outline;
  outline.frame = {shape.centre, along};
  constexpr int rounds = 3;
  for (int round = 0; round < rounds; ++round) {
    const auto sides = find_sides(scene, shape, outline, round + 1 == rounds);
    if (!sides) return std::nullopt;
    outline.low = fit_side(sides->low, -1), outline.high = fit_side(sides->high, 1);
    if (round + 1 == rounds) break;
    const double slope = (outline.low.slope + outline.high.slope) / 2;
    const double turn = std::atan(slope), shift = (outline.low.at(0) + outline.high.at(0)) / 2;
    outline.frame.origin += shift * outline.frame.across();
    outline.frame.along = (std::cos(turn) * outline.frame.along + std::sin(turn) * outline.frame.across()).normalized();
  }
  return outline;
}

std::optional<BandShares> shares_of(const LineSegmentation& split) {
  if (!std::all_of(split.seen.begin(), split.seen.end(), [](bool seen) { return seen; })) return std::nullopt;
  BandShares shares{};
  for (std::size_t i = 0; i < shares.size(); ++i)
    shares[i] = (split.position[i + 1] - split.position[i]) / (split.position[3] - split.position[0]);
  return shares;
}

// The colours' ends along the shaft, medians over some lines between the sides, and whether most of these lines show
// bands that the marker has at no azimuth.
struct Ends {
  std::optional<double> first_x, last_x;
  bool other_bands = false;
};
Ends find_ends(const Scene& scene, const Outline& outline) {
  constexpr int lines = 9;
  constexpr std::size_t samples = 200;
  const double length = outline.last_x - outline.first_x, margin = 0.25 * length + 10;
  const double start = outline.first_x - margin, step = (length + 2 * margin) / samples;
  std::vector<double> first, last;
  int with_other_bands = 0;
  for (int i = 0; i < lines; ++i) {
    const double fraction = 0.5 + 0.35 * (2.0 * i / (lines - 1) - 1);
    std::array<std::uint8_t, samples> classes{};
    for (std::size_t k = 0; k < samples; ++k) {
      const double x = start + (static_cast<double>(k) + 0.5) * step;
      const double y = outline.low.at(x) + fraction * (outline.high.at(x) - outline.low.at(x));
      classes[k] = scene.class_at(scene.camera.raw_from_ideal(outline.frame.at(x, y)));
    }
    const LineSegmentation split = segment_line(classes, scene.bands);
    if (split.seen[0]) first.push_back(start + split.position[0] * step);
    if (split.seen[3]) last.push_back(start + split.position[3] * step);
    const auto shares = shares_of(split);
    with_other_bands += shares && !has_band_shares(scene.marker, *shares);
  }
  constexpr int most_of_them = 7;
  return {agreed_end(first), agreed_end(last), with_other_bands >= most_of_them};
}

// Point of the axis behind a place on the centre line, from the width of the shaft there.
std::optional<Eigen::Vector3d> axis_point(const Scene& scene, const Outline& outline, double x) {
  const auto ray = [&](double y) { return scene.camera.ray_from_ideal(outline.frame.at(x, y)).normalized(); };
  const Eigen::Vector3d low = ray(outline.low.at(x)), high = ray(outline.high.at(x));
  const double half_angle = std::asin(std::min(1.0, (high - low).norm() / 2));
  if (!(half_angle > 1e-4)) return std::nullopt;
  return scene.marker.radius_m() / std::sin(half_angle) * (low + high).normalized();
}

// A frame at `origin` whose z axis is `axis`.
Rigid3 frame_along(const Eigen::Vector3d& origin, const Eigen::Vector3d& axis) {
  return {rotation_between(Eigen::Vector3d::UnitZ(), axis), origin};
}

}  // namespace

InitialPoses initial_poses(const Scene& scene, const Blob& blob) {
  const auto shape = shape_of(scene, blob);
  if (!shape) return {};
  const auto along = directed(*shape, shape->main_direction);
  if (!along) return {};
  const auto outline = find_outline(scene, *shape, *along);
  if (!outline) return {};
  const Ends ends = find_ends(scene, *outline);
  InitialPoses initial{{}, ends.other_bands};
  std::vector<PoseUnknowns>& poses = initial.poses;
  const double middle_x = (outline->first_x + outline->last_x) / 2;
  const auto middle = axis_point(scene, *outline, middle_x);
  if (!middle) return initial;
  const auto at_depth = [&](double x, double depth_m) -> Eigen::Vector3d {
    const double y = (outline->low.at(x) + outline->high.at(x)) / 2;
    return scene.camera.ray_from_ideal(outline->frame.at(x, y)) * depth_m;
  };
  const double length_m = scene.marker.length_m(), depth_m = middle->z();
  const Eigen::Vector3d image_axis = (at_depth(middle_x + 1, depth_m) - at_depth(middle_x, depth_m)).normalized();
  const auto proximal_at = [&](double z_m) -> Eigen::Vector3d {
    if (ends.first_x) return at_depth(*ends.first_x, z_m);
    if (ends.last_x) return at_depth(*ends.last_x, z_m) - length_m * image_axis;
    return at_depth(outline->first_x, z_m);
  };
  double tilt = 0;
  if (ends.first_x && ends.last_x)
    tilt = std::acos(
        std::min(1.0, (at_depth(*ends.last_x, depth_m) - at_depth(*ends.first_x, depth_m)).norm() / length_m));
  for (const double sign : {1.0, -1.0}) {
    const Eigen::Vector3d axis =
        std::cos(tilt) * image_axis + sign * std::sin(tilt) * Eigen::Vector3d(middle->normalized());
    const Eigen::Vector3d proximal = proximal_at(depth_m - sign * std::sin(tilt) * length_m / 2);
    poses.push_back(PoseUnknowns({frame_along(proximal, axis.normalized()), 0}, false));
    if (tilt < 0.05) break;
  }
  return initial;
}

}  // namespace lapservo::internal
