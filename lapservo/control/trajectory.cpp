#include "lapservo/control/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/joint_vector.h"
#include "lapservo/core/minimum_jerk.h"

namespace lapservo {
using namespace internal;
namespace {

void require(const char* what, const Eigen::Vector4d& values, const Eigen::Array<bool, 4, 1>& good,
             const char* expected) {
  for (std::size_t i = 0; i < 4; ++i)
    if (!good[i])
      throw InputError("trajectory", std::string(what) + "." + std::string(FeatureVector::names[i]),
                       std::to_string(values[i]), expected);
}

void require_finite_features(const char* what, const Eigen::Vector4d& values) {
  require(what, values, values.array().isFinite(), "a finite number");
}

void require_positive_features(const char* what, const Eigen::Vector4d& values) {
  require_finite_features(what, values);
  require(what, values, values.array() > 0, "a number above 0");
}

/// Rests before `start` and after `end` of what it is given.
Trajectory between(double start_s, double end_s, std::function<DesiredFeatures(double)> at) {
  return {end_s, [start_s, end_s, inner = std::move(at)](double time_s) {
            DesiredFeatures desired = inner(std::clamp(time_s, start_s, end_s));
            if (time_s < start_s || time_s > end_s) {
              desired.rate.setZero();
              desired.acceleration.setZero();
            }
            return desired;
          }};
}

struct Segment {
  double start_s = 0, duration_s = 0;
  Eigen::Vector4d from = Eigen::Vector4d::Zero(), change = Eigen::Vector4d::Zero();
};

DesiredFeatures minimum_jerk(const Segment& segment, double time_s) {
  if (segment.duration_s <= 0) return {segment.from + segment.change};
  const double x = std::clamp((time_s - segment.start_s) / segment.duration_s, 0.0, 1.0);
  const double per_s = 1 / segment.duration_s;
  return {segment.from + segment.change * MinimumJerk::position(x), segment.change * MinimumJerk::rate(x) * per_s,
          segment.change * MinimumJerk::acceleration(x) * per_s * per_s};
}

struct Spline {
  std::vector<double> times_s;
  std::vector<Eigen::Vector4d> values, curvatures;  ///< second derivatives at the knots, on the side that moves
  std::vector<bool> rests;                          ///< from this knot to the next
};

/// Natural end conditions; the tridiagonal system by Thomas' algorithm. A rest passes no slope and no curvature on, as
/// if it took no time: what moves before and after it is clamped to it.
Spline natural_spline(std::vector<double> times_s, std::vector<Eigen::Vector4d> values, std::vector<bool> rests) {
  const std::size_t n = times_s.size();
  std::vector<Eigen::Vector4d> curvatures(n, Eigen::Vector4d::Zero());
  std::vector<double> ratio(n, 0.0);
  const auto moves_s = [&](std::size_t i) { return rests[i] ? 0 : times_s[i + 1] - times_s[i]; };
  const auto slope = [&](std::size_t i) -> Eigen::Vector4d {
    return rests[i] ? Eigen::Vector4d::Zero() : Eigen::Vector4d((values[i + 1] - values[i]) / moves_s(i));
  };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double before_s = moves_s(i - 1), after_s = moves_s(i);
    if (rests[i - 1] && rests[i]) continue;
    const Eigen::Vector4d bend = 6 * (slope(i) - slope(i - 1));
    const double pivot = 2 * (before_s + after_s) - before_s * ratio[i - 1];
    ratio[i] = after_s / pivot;
    curvatures[i] = (bend - before_s * curvatures[i - 1]) / pivot;
  }
  for (std::size_t i = n - 1; i-- > 1;) curvatures[i] -= ratio[i] * curvatures[i + 1];
  return {std::move(times_s), std::move(values), std::move(curvatures), std::move(rests)};
}

DesiredFeatures spline_at(const Spline& spline, double time_s) {
  const auto above = std::upper_bound(spline.times_s.begin() + 1, spline.times_s.end() - 1, time_s);
  const auto i = static_cast<std::size_t>(above - spline.times_s.begin()) - 1;
  if (spline.rests[i]) return {spline.values[i]};
  const double h = spline.times_s[i + 1] - spline.times_s[i];
  const double b = (time_s - spline.times_s[i]) / h, a = 1 - b;
  const Eigen::Vector4d &y0 = spline.values[i], &y1 = spline.values[i + 1];
  const Eigen::Vector4d &m0 = spline.curvatures[i], &m1 = spline.curvatures[i + 1];
  return {a * y0 + b * y1 + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * (h * h / 6),
          (y1 - y0) / h + ((3 * b * b - 1) * m1 - (3 * a * a - 1) * m0) * (h / 6), a * m0 + b * m1};
}

void refuse_odd_tip(const TipGoal& goal, const std::string& source) {
  constexpr std::array<const char*, 3> names{"x_m", "y_m", "z_m"};
  constexpr double farthest_m = 1;
  for (int i = 0; i < 3; ++i)
    if (const double value = goal.position_m[i]; !(std::abs(value) <= farthest_m))
      throw InputError(source, std::string("tip.") + names[static_cast<std::size_t>(i)], std::to_string(value),
                       std::isfinite(value) ? "metres: it looks like millimetres" : "a finite number");
  if (goal.roll_rad && !(std::abs(*goal.roll_rad) <= two_pi))
    throw InputError(source, "tip.roll_rad", std::to_string(*goal.roll_rad),
                     std::isfinite(*goal.roll_rad) ? "radians within 2 pi: it looks like degrees" : "a finite number");
}

// A goal of the tip has none by itself.
DesiredFeatures no_features(double) {
  DesiredFeatures none;
  none.features.setConstant(std::numeric_limits<double>::quiet_NaN());
  return none;
}

Trajectory tip_from_table(const CsvTable& table, const std::string& source) {
  std::vector<double> times_s;
  std::vector<TipGoal> goals;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    times_s.push_back(table.number(row, "time_s"));
    goals.push_back({{table.number(row, "x_m"), table.number(row, "y_m"), table.number(row, "z_m")}});
    if (table.has("roll_rad")) goals.back().roll_rad = table.number(row, "roll_rad");
  }
  return tip_trajectory_through(std::move(times_s), goals, source);
}

Trajectory from_table(const CsvTable& table, const std::string& source) {
  if (table.has("x_m")) return tip_from_table(table, source);
  std::vector<double> times_s;
  std::vector<Eigen::Vector4d> values;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    times_s.push_back(table.number(row, "time_s"));
    Eigen::Vector4d& value = values.emplace_back();
    for (int i = 0; i < 4; ++i) value[i] = table.number(row, FeatureVector::names[static_cast<std::size_t>(i)]);
  }
  return trajectory_through(std::move(times_s), std::move(values), source);
}

}  // namespace

Trajectory set_point(const Eigen::Vector4d& features) {
  require_finite_features("set_point", features);
  return {0, [features](double) { return DesiredFeatures{features}; }};
}

Trajectory sinusoids(const Sinusoids& sinusoids) {
  require_finite_features("offset", sinusoids.offset);
  require_finite_features("amplitude", sinusoids.amplitude);
  require_finite_features("phase_rad", sinusoids.phase_rad);
  require_positive_features("omega_rad_s", sinusoids.omega_rad_s);
  return {0, [sinusoids](double time_s) {
            const Eigen::Array4d omega = sinusoids.omega_rad_s.array();
            const Eigen::Array4d angle = omega * time_s + sinusoids.phase_rad.array();
            const Eigen::Array4d amplitude = sinusoids.amplitude.array();
            return DesiredFeatures{sinusoids.offset + (amplitude * angle.sin()).matrix(),
                                   amplitude * omega * angle.cos(), -amplitude * omega * omega * angle.sin()};
          }};
}

Trajectory via_points(const std::vector<Eigen::Vector4d>& points, const Eigen::Vector4d& max_rate, double dwell_s) {
  if (points.size() < 2) throw InputError("trajectory", "points", std::to_string(points.size()), "two points or more");
  require_positive_features("max_rate", max_rate);
  if (!(dwell_s >= 0 && std::isfinite(dwell_s)))
    throw InputError("trajectory", "dwell_s", std::to_string(dwell_s), "0 or more seconds");
  std::vector<Segment> segments;
  Eigen::Vector4d from = points.front();
  double start_s = 0;
  for (std::size_t i = 1; i < points.size(); ++i) {
    require_finite_features("points", points[i - 1]);
    require_finite_features("points", points[i]);
    Eigen::Vector4d change = points[i] - from;
    change[0] = wrap_pi(change[0]);
    const double duration_s = MinimumJerk::peak_rate * change.cwiseAbs().cwiseQuotient(max_rate).maxCoeff();
    segments.push_back({start_s, duration_s, from, change});
    from += change;
    start_s += duration_s + dwell_s;
  }
  return between(0, start_s - dwell_s, [segments](double time_s) {
    const auto next = std::upper_bound(segments.begin() + 1, segments.end(), time_s,
                                       [](double t, const Segment& segment) { return t < segment.start_s; });
    return minimum_jerk(*(next - 1), time_s);
  });
}

Trajectory trajectory_through(std::vector<double> times_s, std::vector<Eigen::Vector4d> features,
                              const std::string& source) {
  if (times_s.size() < 2 || times_s.size() != features.size())
    throw InputError(source, "expected at least two rows of time_s,s_rad,r_px,l_px,d_px or time_s,x_m,y_m,z_m");
  std::vector<bool> rests;  // from a row to one that is equal as it is given
  for (std::size_t row = 1; row < features.size(); ++row) rests.push_back(features[row] == features[row - 1]);
  for (std::size_t row = 0; row < times_s.size(); ++row) {
    require_finite_features("features", features[row]);
    if (!std::isfinite(times_s[row]) || (row > 0 && !(times_s[row] > times_s[row - 1])))
      throw InputError(source, "row " + std::to_string(row + 1) + ".time_s", std::to_string(times_s[row]),
                       row == 0 ? "a number" : "a time after " + std::to_string(times_s[row - 1]));
    if (row > 0) features[row][0] = features[row - 1][0] + wrap_pi(features[row][0] - features[row - 1][0]);
  }
  const double start_s = times_s.front(), end_s = times_s.back();
  constexpr double latest_start_s = 3600;
  if (!(start_s >= 0 && start_s <= latest_start_s))
    throw InputError(source, "row 1.time_s", std::to_string(start_s),
                     "seconds since the start of the motion, 0 to 3600: subtract the first row's time from all");
  return between(start_s, end_s,
                 [spline = natural_spline(std::move(times_s), std::move(features), std::move(rests))](double time_s) {
                   return spline_at(spline, time_s);
                 });
}

Trajectory tip_set_point(const TipGoal& goal, const std::string& source) {
  refuse_odd_tip(goal, source);
  return {0, no_features, [goal](double) { return goal; }};
}

Trajectory tip_trajectory_through(std::vector<double> times_s, const std::vector<TipGoal>& goals,
                                  const std::string& source) {
  std::vector<Eigen::Vector4d> rolls_and_places;  // the roll comes first, where features have the angle s
  for (const TipGoal& goal : goals) {
    refuse_odd_tip(goal, source);
    rolls_and_places.emplace_back();
    rolls_and_places.back() << goal.roll_rad.value_or(0), goal.position_m;
  }
  const Trajectory through = trajectory_through(std::move(times_s), std::move(rolls_and_places), source);
  const bool turns = !goals.empty() && goals.front().roll_rad;
  return {through.duration_s, no_features, [at = through.at, turns](double time_s) {
            const Eigen::Vector4d now = at(time_s).features;
            return TipGoal{now.tail<3>(), turns ? std::optional(now[0]) : std::nullopt};
          }};
}

Trajectory trajectory_from_csv(const std::filesystem::path& path) {
  return from_table(CsvTable::read(path), path.string());
}

Trajectory trajectory_from_csv_text(std::string_view text, const std::string& source) {
  return from_table(CsvTable::parse(text, source), source);
}

}  // namespace lapservo
