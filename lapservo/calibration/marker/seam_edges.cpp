#include "lapservo/calibration/marker/seam_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/LU>

#include "lapservo/core/angles.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/model/common_errors.h"

namespace lapservo::internal {
namespace {

constexpr double farthest_rad = 0.85;  // of the seam from the facing generatrix
constexpr double visible_rad = 1.2;    // samples beyond are too foreshortened
constexpr double turned_rad = 0.1;     // an edge's face that is seen by less than this is too thin to matter
constexpr int stations = 40;
constexpr std::size_t min_stations = 3;
constexpr double floor_px = 0.04;  // what the model leaves out
constexpr double max_sigma_px = 4;
// The rest of the light is alike along the shaft and from pixel to pixel: a highlight beside an edge moves it by 0.4
// px, compression by 0.15, for which independent noise would make sigmas of 0.06 and 0.04.
constexpr double sigmas_by_alike_noise = 4;
constexpr double min_explained = 0.8;  // of the light's variance that the edges leave unexplained without them

double normal_cdf(double x) {
  return 0.5 * std::erfc(-x / std::sqrt(2.0));
}

// Light across the seam, a mean of stations with the same bands on either side.
struct Profile {
  int left_band = 0, right_band = 0;
  double stations = 0, along_m = 0;          // how many, and their mean place
  std::vector<std::array<double, 3>> light;  // sums, per sample
  std::vector<int> count;
};

// Highlights lie over print and bare shaft alike (each with its own would pass for the blur of colour differences) and
// are as narrow as the surface is smooth, which nobody knows: a wide one and a narrow one, powers of the cosine.
constexpr std::array<double, 2> gloss_exponents{16, 64};

// The light of a lamp beside the camera on a surface that is turned away from it.
struct LampLight {
  double matt;
  std::array<double, gloss_exponents.size()> gloss;
};

struct Section {
  std::vector<double> x_m;  // around the shaft from where the upper edge is expected
  std::vector<double> px_per_m;
  std::vector<LampLight> lamp;
  std::vector<Profile> profiles;
  std::array<double, 3> shaft{};  // light of the bare shaft
  std::size_t channels = 3;       // 1 of a grey image: all show the same
};

struct SeamView {
  const Scene& scene;
  const LightImage& light;
  const PoseUnknowns& unknowns;
  Eigen::Matrix3d axes;
  double upper_rad = 0;  // azimuth of the upper edge, unrolled frame

  const Marker& marker() const { return scene.marker; }
  Eigen::Vector3d outwards(double azimuth_rad) const {
    return std::cos(azimuth_rad) * axes.col(0) + std::sin(azimuth_rad) * axes.col(1);
  }
  Eigen::Vector3d around(double azimuth_rad) const {
    return std::cos(azimuth_rad) * axes.col(1) - std::sin(azimuth_rad) * axes.col(0);
  }
  Eigen::Vector3d point(double azimuth_rad, double along_m) const {
    return unknowns.pose().camera_from_unrolled.translation + marker().radius_m() * outwards(azimuth_rad) +
           along_m * axes.col(2);
  }
  double azimuth(double x_m) const { return upper_rad + x_m / marker().radius_m(); }
  double px_per_m(double azimuth_rad, double along_m) const {
    const auto image = scene.camera.raw_with_jacobian(point(azimuth_rad, along_m));
    return (image.d_px_d_point * around(azimuth_rad)).norm();
  }
  LampLight lamp_light(double azimuth_rad, double facing_rad) const {
    constexpr double least_matt = 0.05;  // so that shading can make up for other lamps
    const Eigen::Vector3d to_camera = -point(azimuth_rad, marker().length_m() / 2).normalized();
    LampLight lamp{std::max(least_matt, outwards(azimuth_rad).dot(to_camera)), {}};
    const double cosine = std::max(0.0, std::cos(azimuth_rad - facing_rad));
    for (std::size_t i = 0; i < lamp.gloss.size(); ++i) lamp.gloss[i] = std::pow(cosine, gloss_exponents[i]);
    return lamp;
  }
};

// The band at a place, with some room to its boundaries, else 0.
int band_at(const Marker& marker, double tau_rad, double along_m, double room_m) {
  const auto e = boundaries_m(marker, tau_rad);
  for (int band = 1; band <= 3; ++band)
    if (along_m > e[static_cast<std::size_t>(band - 1)] + room_m &&
        along_m < e[static_cast<std::size_t>(band)] - room_m)
      return band;
  return 0;
}

// The band that a station shows from tau_a to tau_b; 0 when it is not one alone.
int one_band(const Marker& marker, double tau_a_rad, double tau_b_rad, double along_m, double room_m) {
  const int a = band_at(marker, tau_a_rad, along_m, room_m), b = band_at(marker, tau_b_rad, along_m, room_m);
  return a == b ? a : 0;
}

// The bare shaft beside the marker's ends, on the seam's azimuth.
std::array<double, 3> shaft_light(const SeamView& view, double blur_px) {
  const Marker& marker = view.marker();
  std::array<std::vector<float>, 3> values;
  for (int i = 0; i < 12; ++i) {
    const double beyond_m = 1.5e-3 + 0.15e-3 * i + 2e-5 * blur_px;
    for (const double along_m : {-beyond_m, marker.length_m() + beyond_m}) {
      const Eigen::Vector2d px = view.scene.camera.raw_from_point(view.point(view.upper_rad, along_m));
      if (!view.light.contains(px)) continue;
      const auto at = view.light.at(static_cast<float>(px.x()), static_cast<float>(px.y()));
      for (std::size_t c = 0; c < 3; ++c) values[c].push_back(at.light[c]);
    }
  }
  std::array<double, 3> light{0.02, 0.02, 0.02};
  for (std::size_t c = 0; c < 3; ++c)
    if (values[c].size() >= 4) light[c] = static_cast<double>(median(values[c]));
  return light;
}

std::optional<Section> sample(const SeamView& view, double facing_rad, double blur_px, double reach_m) {
  const Marker& marker = view.marker();
  const double radius_m = marker.radius_m(), gap_m = marker.gap_rad * radius_m;
  const double middle_m = marker.length_m() / 2;
  const auto scale_at = [&](double x_m) { return view.px_per_m(view.azimuth(x_m), middle_m); };
  const double here = scale_at(0);
  if (!(here > 1)) return std::nullopt;
  const double flank_m = (3 * blur_px + 4) / here, left_m = -gap_m - reach_m - flank_m, right_m = reach_m + flank_m;
  Section section;
  for (double x_m = left_m; x_m <= right_m && section.x_m.size() < 400;) {
    const double px_per_m = scale_at(x_m);
    if (!(px_per_m > 0.1 * here)) return std::nullopt;
    if (std::abs(wrap_pi(view.azimuth(x_m) - facing_rad)) < visible_rad) {
      section.x_m.push_back(x_m);
      section.px_per_m.push_back(px_per_m);
      section.lamp.push_back(view.lamp_light(view.azimuth(x_m), facing_rad));
    }
    x_m += 1 / px_per_m;
  }
  if (section.x_m.size() < 8) return std::nullopt;
  const double room_m = 2.5 * blur_px / here + 0.2 * reach_m;
  for (int station = 0; station < stations; ++station) {
    const double along_m = marker.length_m() * (station + 0.5) / stations;
    const int right = one_band(marker, 0, right_m / radius_m, along_m, room_m);
    const double end_rad = std::nextafter(marker.covered_rad(), 0.0);
    const int left = one_band(marker, end_rad, end_rad - (-left_m - gap_m) / radius_m, along_m, room_m);
    if (left == 0 || right == 0) continue;
    auto found = std::find_if(section.profiles.begin(), section.profiles.end(),
                              [&](const Profile& p) { return p.left_band == left && p.right_band == right; });
    if (found == section.profiles.end()) {
      section.profiles.push_back({left, right, 0, 0, {}, {}});
      found = section.profiles.end() - 1;
      found->light.resize(section.x_m.size()), found->count.resize(section.x_m.size());
    }
    found->stations += 1, found->along_m += along_m;
    for (std::size_t i = 0; i < section.x_m.size(); ++i) {
      const Eigen::Vector2d px = view.scene.camera.raw_from_point(view.point(view.azimuth(section.x_m[i]), along_m));
      if (!view.light.contains(px)) continue;
      const auto at = view.light.at(static_cast<float>(px.x()), static_cast<float>(px.y()));
      if (at.saturated[0] || at.saturated[1] || at.saturated[2]) continue;
      for (std::size_t c = 0; c < 3; ++c) found->light[i][c] += static_cast<double>(at.light[c]);
      ++found->count[i];
    }
  }
  std::erase_if(section.profiles, [](const Profile& p) { return p.stations < min_stations; });
  if (section.profiles.empty()) return std::nullopt;
  for (Profile& profile : section.profiles) profile.along_m /= profile.stations;
  section.shaft = shaft_light(view, blur_px);
  return section;
}

// The bands' and, beyond what the lamp does, their shading; the shaft's; the highlights'.
enum SeamColour : int { left_band, left_shading, right_band, right_shading, bare_shaft, first_gloss };
constexpr int seam_colours = first_gloss + static_cast<int>(gloss_exponents.size());
using SeamBasis = Eigen::Matrix<double, Eigen::Dynamic, seam_colours>;

// How much of each colour a sample shows when the upper edge lies at `upper_m` and the other one `gap_m` before it.
SeamBasis basis_of(const Section& section, double upper_m, double gap_m, double blur_px, double radius_m) {
  const auto scale_at = [&](double x_m) {
    const auto next = std::lower_bound(section.x_m.begin(), section.x_m.end(), x_m);
    const auto i =
        std::min<std::ptrdiff_t>(next - section.x_m.begin(), static_cast<std::ptrdiff_t>(section.x_m.size()) - 1);
    return section.px_per_m[static_cast<std::size_t>(i)];
  };
  const double lower_m = upper_m - gap_m, per_upper = scale_at(upper_m) / blur_px,
               per_lower = scale_at(lower_m) / blur_px;
  const auto samples = static_cast<Eigen::Index>(section.x_m.size());
  SeamBasis basis(samples, seam_colours);
  for (Eigen::Index i = 0; i < samples; ++i) {
    const double x = section.x_m[static_cast<std::size_t>(i)], turn = x / radius_m;
    const double left = normal_cdf((lower_m - x) * per_lower), right = normal_cdf((x - upper_m) * per_upper);
    const LampLight& lamp = section.lamp[static_cast<std::size_t>(i)];
    basis.row(i).head<first_gloss>() << left * lamp.matt, left * lamp.matt * turn, right * lamp.matt,
        right * lamp.matt * turn, 1 - left - right;
    for (std::size_t k = 0; k < lamp.gloss.size(); ++k) basis(i, first_gloss + static_cast<int>(k)) = lamp.gloss[k];
  }
  return basis;
}

// 1 where most of a profile's stations show light.
Eigen::VectorXd used_samples(const Profile& profile) {
  Eigen::VectorXd used(static_cast<Eigen::Index>(profile.count.size()));
  for (Eigen::Index i = 0; i < used.size(); ++i)
    used[i] = 2 * profile.count[static_cast<std::size_t>(i)] > profile.stations ? 1 : 0;
  return used;
}

Eigen::VectorXd light_of(const Profile& profile, std::size_t channel, const Eigen::VectorXd& used) {
  Eigen::VectorXd light(used.size());
  for (Eigen::Index i = 0; i < used.size(); ++i) {
    const auto k = static_cast<std::size_t>(i);
    light[i] = used[i] > 0 ? profile.light[k][channel] / profile.count[k] : 0;
  }
  return light;
}

using SeamColours = Eigen::Matrix<double, seam_colours, 1>;

// The colours that fit a profile's light best. In units of a hundredth of white: shading over a radian is of the
// light's size, highlights are up to a third of white, the shaft's light is known to a third.
class ColourFit {
 public:
  ColourFit(const SeamBasis& basis, const Eigen::VectorXd& used)
      : weighted_(basis.transpose() * used.asDiagonal()), information_(weighted_.lazyProduct(basis)) {
    for (const int shading : {left_shading, right_shading}) information_(shading, shading) += unit * unit;
    for (const int band : {left_band, right_band}) information_(band, band) += 1e-9;
    constexpr double by_gloss = unit / gloss_sigma;
    for (int gloss = first_gloss; gloss < seam_colours; ++gloss) information_(gloss, gloss) += by_gloss * by_gloss;
  }

  SeamColours colours(const Eigen::VectorXd& light, double shaft) const {
    const double shaft_sigma = 0.3 * shaft + 0.005, weight = unit * unit / (shaft_sigma * shaft_sigma);
    SeamInformation information = information_;
    SeamColours gradient = weighted_.lazyProduct(light);
    information(bare_shaft, bare_shaft) += weight;
    gradient[bare_shaft] += shaft * weight;
    return solve_symmetric(information, gradient);
  }

 private:
  using SeamInformation = Eigen::Matrix<double, seam_colours, seam_colours>;
  static constexpr double unit = 0.01, gloss_sigma = 0.3;

  Eigen::Matrix<double, seam_colours, Eigen::Dynamic> weighted_;
  SeamInformation information_;
};

// Residuals of all profiles with edges there; colours, shading and the shaft's light are those that fit best. Weighted
// by the root of the stations, so that noise is alike.
Eigen::VectorXd residuals(const Section& section, double upper_m, double gap_m, double blur_px, double radius_m) {
  const SeamBasis basis = basis_of(section, upper_m, gap_m, blur_px, radius_m);
  const Eigen::Index samples = basis.rows();
  Eigen::VectorXd out(samples * static_cast<Eigen::Index>(section.channels * section.profiles.size()));
  Eigen::Index at = 0;
  for (const Profile& profile : section.profiles) {
    const Eigen::VectorXd used = used_samples(profile);
    const ColourFit fit(basis, used);
    for (std::size_t c = 0; c < section.channels; ++c, at += samples) {
      const Eigen::VectorXd light = light_of(profile, c, used);
      const SeamColours colours = fit.colours(light, section.shaft[c]);
      out.segment(at, samples) = std::sqrt(profile.stations) * used.cwiseProduct(light - basis.lazyProduct(colours));
    }
  }
  return out;
}

struct SeamFit {
  double upper_m = 0, gap_m = 0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();
};

struct SeamSearch {
  double expected_gap_m, reach_m, gap_reach_m, radius_m, px_per_m;
};

// From the best of a grid, Gauss-Newton with differences: two unknowns, residuals with the colours projected out.
std::optional<SeamFit> fit(const Section& section, const SeamSearch& search, double blur_px) {
  const auto& [expected_gap_m, reach_m, gap_reach_m, radius_m, px_per_m] = search;
  const auto at = [&](double upper_m, double gap_m) {
    return residuals(section, upper_m, gap_m, blur_px, search.radius_m);
  };
  const double pixel_m = 1 / px_per_m, step_m = std::max(0.8 * blur_px, 1.0) * pixel_m;
  SeamFit best{0, expected_gap_m, {}};
  double best_cost = 1e300, worst_cost = 0;
  const bool free_gap = gap_reach_m > 0;
  const double first_gap_m = std::max(0.0, expected_gap_m - gap_reach_m), last_gap_m = expected_gap_m + gap_reach_m;
  for (double upper_m = -reach_m; upper_m <= reach_m; upper_m += step_m)
    for (double gap_m = first_gap_m; gap_m <= last_gap_m; gap_m += step_m) {
      const double cost = at(upper_m, gap_m).squaredNorm();
      worst_cost = std::max(worst_cost, cost);
      if (cost < best_cost) best_cost = cost, best.upper_m = upper_m, best.gap_m = gap_m;
    }
  const double delta_m = 0.02 * pixel_m;
  Eigen::VectorXd residual = at(best.upper_m, best.gap_m);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  for (int iteration = 0; iteration < 8; ++iteration) {
    Eigen::Matrix<double, Eigen::Dynamic, 2> slopes(residual.size(), 2);
    slopes.col(0) = (at(best.upper_m + delta_m, best.gap_m) - residual) / delta_m;
    slopes.col(1).setZero();
    if (free_gap) slopes.col(1) = (at(best.upper_m, best.gap_m + delta_m) - residual) / delta_m;
    information = slopes.transpose().lazyProduct(slopes);
    information.diagonal() += Eigen::Vector2d(1e-12, free_gap ? 1e-12 : 1e9) * information.trace();
    Eigen::Vector2d step = -information.inverse() * slopes.transpose().lazyProduct(residual);
    if (!step.allFinite()) return std::nullopt;
    step = step.cwiseMax(-2 * step_m).cwiseMin(2 * step_m);
    Eigen::VectorXd next = at(best.upper_m + step[0], best.gap_m + step[1]);
    if (next.squaredNorm() > residual.squaredNorm()) break;
    best.upper_m += step[0], best.gap_m += step[1], residual = std::move(next);
    if (step.norm() < 0.002 * pixel_m) break;
  }
  if (std::abs(best.upper_m) > 1.2 * reach_m) return std::nullopt;
  if (residual.squaredNorm() > min_explained * worst_cost) return std::nullopt;
  const double freedom =
      std::max<double>(1, 0.6 * static_cast<double>(residual.size()));  // colours, and neighbours share pixels
  best.covariance =
      sigmas_by_alike_noise * sigmas_by_alike_noise * residual.squaredNorm() / freedom * information.inverse();
  return best.covariance.allFinite() ? std::optional(best) : std::nullopt;
}

// Edges that lie where they were found would be found `moved`: by so much the others were, to a part of it.
void take_off(SeamFit& found, const SeamFit& moved) {
  const double upper_m = moved.upper_m - found.upper_m, gap_m = moved.gap_m - found.gap_m;
  const double left = usual_errors.fraction_of_processing;
  found.upper_m -= upper_m, found.gap_m = std::max(0.0, found.gap_m - gap_m);
  found.covariance.diagonal() += left * left * Eigen::Vector2d(upper_m * upper_m, gap_m * gap_m);
}

// Lines between pixels are sampled linearly, which blurs light by so much on average.
constexpr double seam_sampling_px2 = 1.0 / 6;

std::vector<std::array<double, 3>> sampled(const std::vector<std::array<double, 3>>& light) {
  std::vector<std::array<double, 3>> out = light;
  for (std::size_t i = 1; i + 1 < light.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      out[i][c] += seam_sampling_px2 / 2 * (light[i - 1][c] - 2 * light[i][c] + light[i + 1][c]);
  return out;
}

// The effect of the processing on light across edges that lie where they were found; `seen_px`: what blurs them in the
// image whose colours are fitted.
Section processed(const Section& section, const SeamFit& found, double seen_px, double radius_m,
                  const PictureProcessing& processing, const LightTable& light_of_value, bool grey) {
  const SeamBasis seen = basis_of(section, found.upper_m, found.gap_m, seen_px, radius_m);
  const SeamBasis true_basis = basis_of(section, found.upper_m, found.gap_m, processing.blur_px, radius_m);
  Section out = section;
  for (Profile& profile : out.profiles) {
    const Eigen::VectorXd used = used_samples(profile);
    const ColourFit fit(seen, used);
    std::vector<std::array<double, 3>> light(section.x_m.size());
    for (std::size_t c = 0; c < 3; ++c) {
      const SeamColours colours = fit.colours(light_of(profile, c, used), section.shaft[c]);
      for (std::size_t i = 0; i < light.size(); ++i)
        light[i][c] = true_basis.row(static_cast<Eigen::Index>(i)).dot(colours);
    }
    profile.light = filtered_light(light_of_value, processing, light, grey);
    if (grey) profile.light = sampled(profile.light);
    for (std::size_t i = 0; i < light.size(); ++i)
      for (double& channel : profile.light[i]) channel *= profile.count[i];
  }
  return out;
}

// By one image, whose light is blurred by so much; what the processing of the one with all colours moves the edges by
// is taken off.
std::optional<SeamFit> fit_processed(const Section& fitted, double blur_px, const Section& colours, double colours_px,
                                     const SeamSearch& search, const std::optional<PictureProcessing>& processing,
                                     const LightTable& light_of_value) {
  auto found = fit(fitted, search, blur_px);
  if (!found || !processing) return found;
  Section made =
      processed(colours, *found, colours_px, search.radius_m, *processing, light_of_value, fitted.channels == 1);
  made.channels = fitted.channels, made.shaft = fitted.shaft;
  SeamSearch again = search;
  again.expected_gap_m = found->gap_m;
  if (const auto moved = fit(made, again, blur_px)) take_off(*found, *moved);
  return found;
}

// An edge of the print that was found `beyond_m` around the shaft from where it is expected.
SeamEdge edge_at(const SeamView& view, double azimuth_rad, double along_m, double beyond_m, double variance_m2,
                 bool moves_with_gap) {
  const Eigen::Vector3d point = view.point(azimuth_rad, along_m), around = view.around(azimuth_rad);
  const auto image = view.scene.camera.raw_with_jacobian(point);
  const Eigen::Vector2d across = image.d_px_d_point * around;
  const double px_per_m = across.norm(), radius_m = view.marker().radius_m();
  const Eigen::Vector3d pull = image.d_px_d_point.transpose() * (across / px_per_m);
  SeamEdge edge;
  edge.row = view.unknowns.row(point, pull);
  edge.row[psi_unknown] = radius_m * pull.dot(around);
  edge.residual_px = px_per_m * beyond_m;
  edge.sigma_px = std::sqrt(px_per_m * px_per_m * variance_m2 + floor_px * floor_px);
  edge.by_gap_px = moves_with_gap ? -radius_m * pull.dot(around) : 0;
  return edge;
}

}  // namespace

std::optional<SeamEdges> measure_seam(const Scene& scene, const LightImage& light, const PoseUnknowns& unknowns,
                                      double blur_px, double reach_m, bool free_gap,
                                      const std::optional<PictureProcessing>& processing, const LightImage* grey) {
  const Marker& marker = scene.marker;
  const ShaftPose& pose = unknowns.pose();
  const auto cylinder = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!cylinder) return std::nullopt;
  SeamView view{scene, light, unknowns, pose.camera_from_unrolled.rotation.toRotationMatrix(),
                pose.psi_rad + marker.seam_rad};

  const double gap_m = marker.gap_rad * marker.radius_m();
  const double turned_upper_rad = wrap_pi(view.upper_rad - cylinder->facing_azimuth_rad);
  if (std::abs(turned_upper_rad - marker.gap_rad / 2) > farthest_rad) return std::nullopt;
  auto section = sample(view, cylinder->facing_azimuth_rad, blur_px, reach_m);
  if (!section) return std::nullopt;
  double along_m = 0, weight = 0;
  for (const Profile& profile : section->profiles)
    along_m += profile.stations * profile.along_m, weight += profile.stations;
  along_m /= weight;
  const double px_per_m = view.px_per_m(view.upper_rad, along_m), radius_m = marker.radius_m();
  const SeamSearch search{gap_m, reach_m, free_gap ? reach_m : 0, radius_m, px_per_m};
  std::optional<SeamFit> found;
  if (grey != nullptr && processing) {
    const SeamView grey_view{scene, *grey, unknowns, view.axes, view.upper_rad};
    auto in_grey = sample(grey_view, cylinder->facing_azimuth_rad, blur_px, reach_m);
    if (!in_grey) return std::nullopt;
    in_grey->channels = 1;
    // Colour differences are blurred far wider, over the gap and into each other.
    const double grey_px = std::sqrt(processing->blur_px * processing->blur_px + seam_sampling_px2);
    found = fit_processed(*in_grey, grey_px, *section, blur_px, search, processing, light.light_of_value());
  } else {
    found = fit_processed(*section, blur_px, *section, blur_px, search, processing, light.light_of_value());
  }
  if (!found) return std::nullopt;

  SeamEdges edges;
  edges.gap_rad = found->gap_m / radius_m;
  edges.sigma_gap_rad = std::hypot(std::sqrt(found->covariance(1, 1)), floor_px / px_per_m) / radius_m;
  const double found_upper_rad = turned_upper_rad + found->upper_m / radius_m;
  if (!free_gap || found_upper_rad < turned_rad) {
    edges.upper = edge_at(view, view.upper_rad, along_m, found->upper_m, found->covariance(0, 0), false);
    if (edges.upper->sigma_px > max_sigma_px) edges.upper.reset();
  }
  if (free_gap && found_upper_rad - edges.gap_rad > -turned_rad) {
    const double variance_m2 = found->covariance(0, 0) + found->covariance(1, 1) - 2 * found->covariance(0, 1);
    edges.lower = edge_at(view, view.upper_rad - marker.gap_rad, along_m, found->upper_m - found->gap_m + gap_m,
                          variance_m2, true);
    if (edges.lower->sigma_px > max_sigma_px) edges.lower.reset();
  }
  return edges;
}

}  // namespace lapservo::internal
