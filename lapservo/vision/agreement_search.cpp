#include "lapservo/vision/agreement_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"
#include "lapservo/vision/limits.h"

namespace lapservo::internal {
namespace {

constexpr double hidden = -0.35, wrong = -1, beside = -1, rightly_empty = 0.15;

// Colours on the marker, beyond its ends and just outside its sides against what should be there.
double agreement(const Scene& scene, const ShaftPose& pose) {
  constexpr int lines = 9, places = 36, margin = 6;
  const auto view = view_cylinder(pose.camera_from_unrolled, scene.marker.radius_m());
  if (!view) return -1e9;
  const double length_m = scene.marker.length_m(), radius_m = scene.marker.radius_m();
  const Eigen::Vector3d axis = pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  const auto base_of = [&](double radius, double azimuth_rad) -> Eigen::Vector3d {
    return pose.camera_from_unrolled * surface_point(radius, azimuth_rad, 0);
  };
  double score = 0;
  const auto count_empty = [&](std::uint8_t color) {
    if (color != Scene::outside) score += scene.is_ours(color) ? beside : rightly_empty;
  };
  for (int i = 0; i < lines; ++i) {
    const double azimuth_rad = view->facing_azimuth_rad + 0.85 * view->half_visible_rad * (2.0 * i / (lines - 1) - 1);
    const double tau_rad = marker_azimuth_rad(scene.marker, azimuth_rad, pose.psi_rad);
    const bool printed = is_printed(scene.marker, tau_rad);
    const auto ends_m = boundaries_m(scene.marker, tau_rad);
    const Eigen::Vector3d base = base_of(radius_m, azimuth_rad);
    for (int k = -margin; k < places + margin; ++k) {
      const double along_m = length_m * (k + 0.5) / places;
      const auto band = std::upper_bound(ends_m.begin(), ends_m.end(), along_m) - ends_m.begin();
      const bool empty = !printed || band < 1 || band > 3;
      const Eigen::Vector3d point = base + along_m * axis;
      const std::uint8_t color = empty ? scene.class_at_point(point) : scene.class_on_shaft(point);
      if (color == Scene::outside) continue;
      if (empty) {
        count_empty(color);
      } else if (color == scene.bands[static_cast<std::size_t>(band - 1)]) {
        score += 1;
      } else {
        score += scene.is_ours(color) ? wrong : hidden;
      }
    }
  }
  for (const double side : {-1.0, 1.0})
    for (const double radii : {1.08, 1.2}) {
      const Eigen::Vector3d base = base_of(radii * radius_m, view->facing_azimuth_rad + side * pi / 2);
      for (int k = 0; k < places; ++k) count_empty(scene.class_at_point(base + length_m * (k + 0.5) / places * axis));
    }
  return score;
}

constexpr int rotations = 6, halvings = 5, directions = 14, max_moves = 8;
const Eigen::Vector4d first_steps(0.03, 0.12, 0.006, 0.5);

}  // namespace

std::optional<PoseUnknowns> AgreementSearch::ImageTerms::unknowns(const Eigen::Vector4d& at) const {
  const Eigen::Vector3d direction = (axis + at[0] * across + at[1] * away).normalized();
  const auto q = configuration_through(camera_from_rcm, camera_from_rcm.translation + at[2] * direction);
  if (!q) return std::nullopt;
  return PoseUnknowns::rcm(camera_from_rcm, {q->theta_rad, q->phi_rad, q->rho_m, at[3]});
}

AgreementSearch::ImageTerms AgreementSearch::ImageTerms::of(const Rigid3& camera_from_rcm, const PoseUnknowns& start) {
  const Eigen::Vector3d place = start.pose().camera_from_unrolled.translation;
  ImageTerms terms{camera_from_rcm, (place - camera_from_rcm.translation).normalized(), {}, {}, {}};
  terms.across = place.cross(terms.axis).normalized();
  terms.away = terms.axis.cross(terms.across).normalized();
  terms.values = {0, 0, (place - camera_from_rcm.translation).norm(), start.pose().psi_rad};
  return terms;
}

AgreementSearch::AgreementSearch(const PoseUnknowns& start, const Rigid3& camera_from_rcm)
    : camera_from_rcm_(camera_from_rcm), start_(start) {}

double AgreementSearch::score_at(const Scene& scene, const ImageTerms& terms, const Eigen::Vector4d& at,
                                 WorkBudget& budget) const {
  budget.spend(search_costs.agreement);
  const auto unknowns = terms.unknowns(at);
  return unknowns ? agreement(scene, unknowns->pose()) : -1e9;
}

// Tries the axes and random directions both ways and keeps what is better; whether anything was.
bool AgreementSearch::move(const Scene& scene, Climb& climb, WorkBudget& budget) {
  bool moved = false;
  for (int i = 0; i < directions; ++i) {
    Eigen::Vector4d direction = Eigen::Vector4d::Unit(i % 4);
    if (i >= 4)
      for (double& part : direction) part = random_.normal();
    for (const double sign : {1.0, -1.0}) {
      const Eigen::Vector4d trial = climb.terms.values + sign * climb.steps.cwiseProduct(direction);
      const double score = score_at(scene, climb.terms, trial, budget);
      if (score <= climb.score) continue;
      climb.score = score, climb.terms.values = trial, moved = true;
      break;
    }
  }
  return moved;
}

// Moves, and halves the steps when nothing is better, until the steps are small. False when the budget ends first.
bool AgreementSearch::finish(const Scene& scene, Climb& climb, WorkBudget& budget) {
  while (climb.halvings < halvings) {
    if (!budget.allows(2 * directions * search_costs.agreement)) return false;
    const bool moved = move(scene, climb, budget);
    if (moved && ++climb.moves < max_moves) continue;
    ++climb.halvings, climb.moves = 0, climb.steps /= 2;
  }
  return true;
}

bool AgreementSearch::advance(const Scene& scene, WorkBudget& budget) {
  ++frames_;
  if (climb_) climb_->score = score_at(scene, climb_->terms, climb_->terms.values, budget);
  for (; rotation_ < rotations; ++rotation_) {
    if (!climb_) {
      climb_ = Climb{ImageTerms::of(camera_from_rcm_, start_), first_steps};
      climb_->terms.values[3] = two_pi * rotation_ / rotations;
      climb_->score = score_at(scene, climb_->terms, climb_->terms.values, budget);
    }
    if (!finish(scene, *climb_, budget)) return false;
    if (const auto unknowns = climb_->terms.unknowns(climb_->terms.values))
      results_.push_back({climb_->score, *unknowns});
    climb_.reset();
  }
  return true;
}

std::vector<PoseUnknowns> AgreementSearch::results() const {
  std::vector<Result> sorted = results_;
  std::sort(sorted.begin(), sorted.end(), [](const Result& a, const Result& b) { return a.score > b.score; });
  std::vector<PoseUnknowns> best;
  for (const Result& result : sorted) {
    constexpr double same_rad = 0.2;
    const bool known = std::any_of(best.begin(), best.end(), [&](const PoseUnknowns& other) {
      return std::abs(wrap_pi(other.pose().psi_rad - result.unknowns.pose().psi_rad)) < same_rad;
    });
    if (!known && best.size() < 2) best.push_back(result.unknowns);
  }
  std::reverse(best.begin(), best.end());
  return best;
}

PoseUnknowns AgreementSearch::in_this_frame(const Scene& scene, const PoseUnknowns& result, WorkBudget& budget) {
  if (frames_ == 1) return result;
  constexpr int halved = 3;
  Climb climb{ImageTerms::of(camera_from_rcm_, result), first_steps / (1 << halved)};
  climb.halvings = halved;
  climb.score = score_at(scene, climb.terms, climb.terms.values, budget);
  WorkBudget whole(std::nullopt);
  finish(scene, climb, whole);
  return climb.terms.unknowns(climb.terms.values).value_or(result);
}

}  // namespace lapservo::internal
