#include "lapservo/control/trajectory_check.h"

#include <cmath>

#include <fmt/format.h>

#include "lapservo/control/motion_limits.h"
#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"

namespace lapservo {
using namespace internal;
namespace {

std::optional<std::string> broken_bound(const PositionBounds& bounds, const Eigen::Vector4d& q,
                                        const Eigen::Vector4d& ends_px) {
  constexpr double rounding = 1e-6;  // rad, m, px: of a place on the limit itself
  Eigen::Matrix<double, 8, 1> places;
  places << q, ends_px;
  for (Eigen::Index i = 0; i < places.size(); ++i) {
    const bool above = places[i] > bounds.upper[i] + rounding;
    if (above || places[i] < bounds.lower[i] - rounding)
      return fmt::format("{}: needs {:.4g}", bounds.text({i, above}), places[i]);
  }
  return std::nullopt;
}

std::optional<std::string> broken_rate(const JointLimits& limits, const Eigen::Vector4d& velocity) {
  for (Eigen::Index i = 0; i < 4; ++i)
    if (std::abs(velocity[i]) > limits.rate[i])
      return fmt::format("limits.rate {} {:.4g}: needs {:.4g}", JointVector::names[static_cast<std::size_t>(i)],
                         limits.rate[i], velocity[i]);
  return std::nullopt;
}

// By any marker's image, whatever the camera: the third boundary lies between the two ends.
bool can_be_shown(const Eigen::Vector4d& features) {
  const double r_px = features[1], l_px = features[2], d_px = features[3];
  return features.allFinite() && r_px >= 0 && d_px > 0 && d_px < l_px;
}

}  // namespace

std::optional<std::string> broken_limit(const ControllerConfig& config, const FeatureState& state,
                                        const Eigen::Vector4d& q, const Eigen::Vector4d& rate) {
  const DampedInverse inverse = damped_inverse(state.jacobian, config.scales, config.damping_threshold);
  if (inverse.min_singular_value < config.min_singular_value) return "the Jacobian is singular";
  if (auto broken = broken_bound({config.limits, config.window}, q, state.ends_px)) return broken;
  return broken_rate(config.limits, inverse.inverse * rate);
}

std::string Infeasible::text() const {
  return fmt::format("can't be followed at {:.2f} s: {}", time_s, what);
}

std::optional<Infeasible> find_infeasible(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                                          const ControllerConfig& config, const Eigen::Vector4d& q_start,
                                          double step_s) {
  Eigen::Vector4d q = q_start;
  const auto steps = static_cast<long>(std::ceil(duration_s / step_s));
  for (long i = 0; i <= steps; ++i) {
    const double time_s = step_s * static_cast<double>(i);
    const DesiredFeatures desired = trajectory.at(time_s);
    if (const double s_rad = desired.features[0]; std::abs(s_rad) > two_pi)
      return Infeasible{time_s,
                        fmt::format("s_rad is {:g}, expected radians within 2 pi: it looks like degrees", s_rad)};
    if (!can_be_shown(desired.features)) return Infeasible{time_s, "no image shows these features"};
    if (!model) continue;
    const auto found = newton_inverse(model, desired.features, q, config.scales);
    if (!found || !found->converged) return Infeasible{time_s, "no configuration shows these features"};
    q = found->q;
    if (auto broken = broken_limit(config, *model(q), q, desired.rate)) return Infeasible{time_s, *broken};
  }
  return std::nullopt;
}

void refuse_infeasible(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                       const ControllerConfig& config, const JointVector& q_start, const std::string& source) {
  if (const auto problem = find_infeasible(trajectory, duration_s, model, config, q_start.vector()))
    throw InputError(source, problem->text());
}

}  // namespace lapservo
