#include "lapservo/vision/search/agreement_search.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/colour/colour_evidence.h"
#include "lapservo/vision/search/starts.h"
#include "lapservo/vision/shaft/sampled_surface.h"

namespace lapservo::internal {
namespace {

constexpr int halvings = 5, halvings_of_place = 2, tried_directions = 14, max_moves = 8;
const Eigen::Vector4d first_steps(0.03, 0.12, 0.006, 0.5);
const Eigen::Vector4d steps_of_place = first_steps.cwiseProduct(Eigen::Vector4d(1, 1, 1, 0)),
                      steps_of_rotation = first_steps / (1 << halvings_of_place);
constexpr int rotations = 48;  // of a turn
constexpr std::size_t most_peaks = 4;
constexpr std::array depth_scales{nearer_scale * nearer_scale, nearer_scale, 1.0};

// The pose that shows the same in the middle of the marker, at another depth.
std::optional<PoseUnknowns> seen_at_depth(const PoseUnknowns& start, double scale, const Rigid3& camera_from_rcm,
                                          double length_m) {
  const Eigen::Vector3d middle = scale * point_on_axis(start.pose(), length_m / 2);
  const Eigen::Vector3d axis = (middle - camera_from_rcm.translation).normalized();
  const auto q = configuration_through(camera_from_rcm, middle - length_m / 2 * axis);
  return q ? std::optional(PoseUnknowns(pose_through_rcm(camera_from_rcm, *q), true)) : std::nullopt;
}

// Bits of the bands that may show at each place along a line of the marker.
constexpr std::size_t beyond = 6;  // places beyond each end
constexpr int places_along = surface_places - 2 * beyond;
using BandsAlong = std::array<std::uint8_t, places_along>;

BandsAlong bands_at(const Marker& marker, double tau_rad) {
  BandsAlong bands{};
  if (!is_printed(marker, tau_rad)) return bands;
  const auto ends_m = boundaries_m(marker, tau_rad);
  for (int k = 0; k < places_along; ++k) {
    const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), marker.length_m() * (k + 0.5) / places_along) -
                      ends_m.begin() - 1;
    if (band >= 0 && band < 3) bands[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(1 << band);
  }
  return bands;
}

BandsAlong bands_of_whole_turn(const Marker& marker) {
  constexpr int parts = 4;
  constexpr double inside = 0.999;  // at its lower edge the print ends
  BandsAlong all{};
  for (int i = 0; i <= parts; ++i) {
    const BandsAlong bands = bands_at(marker, inside * marker.covered_rad() * i / parts);
    for (std::size_t k = 0; k < all.size(); ++k) all[k] |= bands[k];
  }
  return all;
}

double area_px2(const Scene& scene, const ShaftPose& pose) {
  const double length_m = scene.marker.length_m();
  const Eigen::Vector3d first = point_on_axis(pose, 0), last = point_on_axis(pose, length_m);
  if (!(first.z() > LensField::nearest_m) || !(last.z() > LensField::nearest_m)) return 0;
  const double width_px = scene.marker.diameter_m * scene.camera.fx_px / point_on_axis(pose, length_m / 2).norm();
  return width_px * (scene.camera.ideal_from_point(last) - scene.camera.ideal_from_point(first)).norm();
}

}  // namespace

double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned, double above_px2) {
  constexpr int lines = 9;
  constexpr double line_reach = 0.85;
  constexpr std::array beside_radii{1.08, 1.2};
  const double most_of_line = places_along + 2 * beyond * colour_evidence.of(Place::shaft, Shows::grey);
  const double most_beside = 2 * beside_radii.size() * places_along * colour_evidence.of(Place::beside, Shows::other);
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return no_area_px2;
  const double whole_px2 = area_px2(scene, pose);
  const double least_gain = above_px2 * (lines * places_along) / whole_px2;
  const Eigen::Vector3d step =
      pose.camera_from_unrolled.rotation * Eigen::Vector3d(0, 0, scene.marker.length_m() / places_along);
  std::array<std::uint8_t, Scene::outside + 1> band_of{};  // by colour class, what bands it may be
  for (std::size_t band = 3; band-- > 0;) band_of[scene.bands[band]] = static_cast<std::uint8_t>(1 << band);
  BandsAlong bands{};
  if (!turned) bands = bands_of_whole_turn(scene.marker);
  double gained = 0;
  for (int i = 0; i < lines; ++i) {
    if (gained + (lines - i) * most_of_line + most_beside < least_gain) return no_area_px2;
    const double azimuth_rad = visible_azimuth_rad(*view, line_reach, i, lines);
    if (turned) bands = bands_at(scene.marker, marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad));
    const Eigen::Vector3d base = point_on(pose, scene.marker, azimuth_rad, 0);
    const LineInImage<surface_places> line(scene, base - beyond * step, step);
    for (std::size_t k = 0; k < surface_places; ++k) {
      // The bands that may show there; none beyond the marker's ends.
      const std::uint8_t here = k >= beyond && k < beyond + places_along ? bands[k - beyond] : 0;
      const std::uint8_t* const bgr = line.pixel(k, here != 0);
      if (!bgr) continue;
      const std::uint8_t seen = band_of[scene.classes(bgr)];
      const Shows shows = !seen ? grey_or_other(bgr) : seen & here ? Shows::its_band : Shows::another_band;
      gained += colour_evidence.of(here ? Place::band : Place::shaft, shows);
    }
  }
  if (gained + most_beside < least_gain) return no_area_px2;
  for (const double side : {-1.0, 1.0})
    for (const double radii : beside_radii) {
      const Eigen::Vector3d base =
          pose.camera_from_unrolled *
          surface_point(radii * scene.marker.radius_m(), view->facing_azimuth_rad + side * pi / 2, 0);
      const LineInImage<places_along> line(scene, base, step);
      for (std::size_t k = 0; k < places_along; ++k)
        if (const std::uint8_t* bgr = line.pixel(k, false))
          gained +=
              colour_evidence.of(Place::beside, band_of[scene.classes(bgr)] ? Shows::another_band : grey_or_other(bgr));
    }
  return gained / (lines * places_along) * whole_px2;
}

std::optional<PoseUnknowns> AgreementSearch::Climb::unknowns(const Eigen::Vector4d& at) const {
  const Eigen::Vector3d direction = (axis + at[0] * across + at[1] * away).normalized();
  const auto q = configuration_through(camera_from_rcm, camera_from_rcm.translation + at[2] * direction);
  if (!q) return std::nullopt;
  return PoseUnknowns(pose_through_rcm(camera_from_rcm, {q->theta_rad, q->phi_rad, q->rho_m, at[3]}), true);
}

AgreementSearch::Climb::Climb(const Rigid3& rcm_frame, const PoseUnknowns& start, const Eigen::Vector4d& first_steps)
    : camera_from_rcm(rcm_frame), steps(first_steps) {
  const Eigen::Vector3d place = start.pose().camera_from_unrolled.translation;
  axis = (place - camera_from_rcm.translation).normalized();
  across = place.cross(axis).normalized();
  away = axis.cross(across).normalized();
  values = {0, 0, (place - camera_from_rcm.translation).norm(), start.pose().psi_rad};
}

AgreementSearch::AgreementSearch(const PoseUnknowns& start, const Rigid3& camera_from_rcm, double length_m)
    : camera_from_rcm_(camera_from_rcm) {
  for (const double scale : depth_scales)
    if (const auto nearer = seen_at_depth(start, scale, camera_from_rcm, length_m))
      waiting_.emplace_back(camera_from_rcm, *nearer, steps_of_place);
}

double AgreementSearch::score_at(const Scene& scene, const Climb& climb, const Eigen::Vector4d& at, WorkBudget& budget,
                                 double above_px2) const {
  budget.spend(search_costs.agreement);
  const auto unknowns = climb.unknowns(at);
  return unknowns ? explained_area_px2(scene, unknowns->pose(), climb.with_rotation(), above_px2) : no_area_px2;
}

// Tries the axes and random directions both ways and keeps what is better; whether anything was.
bool AgreementSearch::move(const Scene& scene, Climb& climb, WorkBudget& budget) {
  bool moved = false;
  const int axes = climb.with_rotation() ? 4 : 3;
  for (int i = 0; i < tried_directions; ++i) {
    Eigen::Vector4d direction = Eigen::Vector4d::Unit(i % axes);
    if (i >= axes)
      for (double& part : direction) part = random_.normal();
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector4d trial = climb.values + sign * climb.steps.cwiseProduct(direction);
      const double score = score_at(scene, climb, trial, budget, climb.score);
      if (score <= climb.score) continue;
      climb.score = score, climb.values = trial, moved = true;
      break;
    }
  }
  return moved;
}

// Moves, and halves the steps when nothing is better, until the steps are small. False when the budget ends first.
bool AgreementSearch::finish(const Scene& scene, Climb& climb, WorkBudget& budget) {
  while (climb.halvings < halvings) {
    if (!budget.allows(2 * tried_directions * search_costs.agreement)) return false;
    if (move(scene, climb, budget) && ++climb.moves < max_moves) continue;
    ++climb.halvings, climb.moves = 0, climb.steps /= 2;
  }
  return true;
}

// From the best place the rotations that agree better with the colours than those beside them, the best of them last.
void AgreementSearch::turn(const Scene& scene, WorkBudget& budget) {
  Climb climb(camera_from_rcm_, best_->unknowns, steps_of_rotation);
  std::array<double, rotations> scores{};
  const auto at = [&](int i) { return scores[static_cast<std::size_t>((i + rotations) % rotations)]; };
  const auto values = [&](int i) -> Eigen::Vector4d { return {0, 0, climb.values[2], two_pi * i / rotations}; };
  for (int i = 0; i < rotations; ++i) scores[static_cast<std::size_t>(i)] = score_at(scene, climb, values(i), budget);
  std::vector<Climb> peaks;
  for (int i = 0; i < rotations; ++i) {
    if (at(i) < std::max(at(i - 1), at(i + 1))) continue;
    climb.values = values(i), climb.score = at(i), climb.halvings = halvings_of_place;
    peaks.push_back(climb);
  }
  std::sort(peaks.begin(), peaks.end(), [](const Climb& a, const Climb& b) { return a.score < b.score; });
  if (peaks.size() > most_peaks) peaks.erase(peaks.begin(), peaks.end() - most_peaks);
  waiting_ = std::move(peaks);
  best_.reset(), turned_ = true;
}

bool AgreementSearch::advance(const Scene& scene, WorkBudget& budget) {
  ++frames_;
  while (true) {
    if (waiting_.empty()) {
      if (turned_ || !best_) return true;
      if (!budget.allows(rotations * search_costs.agreement)) return false;
      turn(scene, budget);
    }
    Climb& climb = waiting_.back();
    climb.score = score_at(scene, climb, climb.values, budget);
    if (!finish(scene, climb, budget)) return false;
    if (const auto unknowns = climb.unknowns(climb.values); unknowns && !(best_ && climb.score <= best_->score))
      best_ = Result{climb.score, *unknowns};
    waiting_.pop_back();
  }
}

std::optional<PoseUnknowns> AgreementSearch::result() const {
  return best_ ? std::optional(best_->unknowns) : std::nullopt;
}

PoseUnknowns AgreementSearch::in_this_frame(const Scene& scene, const PoseUnknowns& result, WorkBudget& budget) {
  if (frames_ == 1) return result;
  constexpr int halved = 3;
  Climb climb(camera_from_rcm_, result, first_steps / (1 << halved));
  climb.halvings = halved;
  climb.score = score_at(scene, climb, climb.values, budget);
  budget.allow(WorkBudget::Beyond::all);
  finish(scene, climb, budget);
  budget.allow(WorkBudget::Beyond::none);
  return climb.unknowns(climb.values).value_or(result);
}

}  // namespace lapservo::internal
