#include "lapservo/vision/search/agreement_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/vision/search/starts.h"

namespace lapservo::internal {
namespace {

constexpr int halvings = 5, halvings_of_place = 2, tried_directions = 14, max_moves = 8;
const Eigen::Vector4d first_steps(0.03, 0.12, 0.006, 0.5);
const Eigen::Vector4d steps_of_place = first_steps.cwiseProduct(Eigen::Vector4d(1, 1, 1, 0)),
                      steps_of_rotation = first_steps / (1 << halvings_of_place);
constexpr int rotations = 48;  // of a turn
constexpr std::size_t most_peaks = 4, most_results = 3;
constexpr std::array depth_scales{0.64, nearer_scale, 1.0};

// The pose that shows the same in the middle of the marker, at another depth.
std::optional<PoseUnknowns> seen_at_depth(const PoseUnknowns& start, double scale, const Rigid3& camera_from_rcm,
                                          double length_m) {
  const Eigen::Vector3d middle = scale * point_on_axis(start.pose(), length_m / 2);
  const Eigen::Vector3d axis = (middle - camera_from_rcm.translation).normalized();
  const auto q = configuration_through(camera_from_rcm, middle - length_m / 2 * axis);
  return q ? std::optional(PoseUnknowns(pose_through_rcm(camera_from_rcm, *q), true)) : std::nullopt;
}

}  // namespace

std::optional<PoseUnknowns> AgreementSearch::ImageTerms::unknowns(const Eigen::Vector4d& at) const {
  const Eigen::Vector3d direction = (axis + at[0] * across + at[1] * away).normalized();
  const auto q = configuration_through(camera_from_rcm, camera_from_rcm.translation + at[2] * direction);
  if (!q) return std::nullopt;
  return PoseUnknowns(pose_through_rcm(camera_from_rcm, {q->theta_rad, q->phi_rad, q->rho_m, at[3]}), true);
}

AgreementSearch::ImageTerms AgreementSearch::ImageTerms::of(const Rigid3& camera_from_rcm, const PoseUnknowns& start) {
  const Eigen::Vector3d place = start.pose().camera_from_unrolled.translation;
  ImageTerms terms{camera_from_rcm, (place - camera_from_rcm.translation).normalized(), {}, {}, {}};
  terms.across = place.cross(terms.axis).normalized();
  terms.away = terms.axis.cross(terms.across).normalized();
  terms.values = {0, 0, (place - camera_from_rcm.translation).norm(), start.pose().psi_rad};
  return terms;
}

AgreementSearch::AgreementSearch(const PoseUnknowns& start, const Rigid3& camera_from_rcm, double length_m)
    : camera_from_rcm_(camera_from_rcm) {
  for (const double scale : depth_scales)
    if (const auto nearer = seen_at_depth(start, scale, camera_from_rcm, length_m))
      waiting_.push_back({ImageTerms::of(camera_from_rcm, *nearer), steps_of_place});
}

double AgreementSearch::score_at(const Scene& scene, const Climb& climb, const Eigen::Vector4d& at, WorkBudget& budget,
                                 double above_px2) const {
  budget.spend(search_costs.agreement);
  const auto unknowns = climb.terms.unknowns(at);
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
      const Eigen::Vector4d trial = climb.terms.values + sign * climb.steps.cwiseProduct(direction);
      const double score = score_at(scene, climb, trial, budget, climb.score);
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
    if (!budget.allows(2 * tried_directions * search_costs.agreement)) return false;
    const bool moved = move(scene, climb, budget);
    if (moved && ++climb.moves < max_moves) continue;
    ++climb.halvings, climb.moves = 0, climb.steps /= 2;
  }
  return true;
}

// From the best place the rotations that agree better with the colours than those beside them, the best of them last.
void AgreementSearch::turn(const Scene& scene, WorkBudget& budget) {
  Climb climb{ImageTerms::of(camera_from_rcm_, place_->unknowns), steps_of_rotation};
  std::array<double, rotations> scores{};
  const auto at = [&](int i) { return scores[static_cast<std::size_t>((i + rotations) % rotations)]; };
  const auto values = [&](int i) -> Eigen::Vector4d { return {0, 0, climb.terms.values[2], two_pi * i / rotations}; };
  for (int i = 0; i < rotations; ++i) scores[static_cast<std::size_t>(i)] = score_at(scene, climb, values(i), budget);
  std::vector<Climb> peaks;
  for (int i = 0; i < rotations; ++i) {
    if (at(i) < std::max(at(i - 1), at(i + 1))) continue;
    climb.terms.values = values(i), climb.score = at(i), climb.halvings = halvings_of_place;
    peaks.push_back(climb);
  }
  std::sort(peaks.begin(), peaks.end(), [](const Climb& a, const Climb& b) { return a.score < b.score; });
  if (peaks.size() > most_peaks) peaks.erase(peaks.begin(), peaks.end() - most_peaks);
  waiting_ = std::move(peaks);
  turned_ = true;
}

bool AgreementSearch::advance(const Scene& scene, WorkBudget& budget) {
  ++frames_;
  if (climb_) climb_->score = score_at(scene, *climb_, climb_->terms.values, budget);
  while (true) {
    if (!climb_ && waiting_.empty()) {
      if (turned_ || !place_) return true;
      if (!budget.allows(rotations * search_costs.agreement)) return false;
      turn(scene, budget);
      continue;
    }
    if (!climb_) {
      climb_ = waiting_.back();
      waiting_.pop_back();
      climb_->score = score_at(scene, *climb_, climb_->terms.values, budget);
    }
    if (!finish(scene, *climb_, budget)) return false;
    if (const auto unknowns = climb_->terms.unknowns(climb_->terms.values)) {
      const Result result{climb_->score, *unknowns};
      if (turned_)
        results_.push_back(result);
      else if (!place_ || result.score > place_->score)
        place_ = result;
    }
    climb_.reset();
  }
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
    if (!known && best.size() < most_results) best.push_back(result.unknowns);
  }
  std::reverse(best.begin(), best.end());
  return best;
}

PoseUnknowns AgreementSearch::in_this_frame(const Scene& scene, const PoseUnknowns& result, WorkBudget& budget) {
  if (frames_ == 1) return result;
  constexpr int halved = 3;
  Climb climb{ImageTerms::of(camera_from_rcm_, result), first_steps / (1 << halved)};
  climb.halvings = halved;
  climb.score = score_at(scene, climb, climb.terms.values, budget);
  budget.allow(WorkBudget::Beyond::all);
  finish(scene, climb, budget);
  budget.allow(WorkBudget::Beyond::none);
  return climb.terms.unknowns(climb.terms.values).value_or(result);
}

}  // namespace lapservo::internal
