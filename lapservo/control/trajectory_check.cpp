#include "lapservo/control/trajectory_check.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr std::array<const char*, 4> end_names{"e0_u_px", "e0_v_px", "e3_u_px", "e3_v_px"};

std::string bound_text(const char* limit, const char* name, double bound, double needed) {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), "%s %s %.4g: needs %.4g", limit, name, bound, needed);
  return text.data();
}

std::optional<std::string> broken_joint_limit(const JointLimits& limits, const Eigen::Vector4d& q,
                                              const Eigen::Vector4d& velocity) {
  for (int i = 0; i < 4; ++i) {
    const char* name = JointVector::names[static_cast<std::size_t>(i)].data();
    if (q[i] < limits.lower[i]) return bound_text("limits.lower", name, limits.lower[i], q[i]);
    if (q[i] > limits.upper[i]) return bound_text("limits.upper", name, limits.upper[i], q[i]);
    if (std::abs(velocity[i]) > limits.rate[i]) return bound_text("limits.rate", name, limits.rate[i], velocity[i]);
  }
  return std::nullopt;
}

std::optional<std::string> outside_window(const ImageWindow& window, const Eigen::Vector4d& ends_px) {
  const Eigen::Vector4d lower(window.u_min_px, window.v_min_px, window.u_min_px, window.v_min_px);
  const Eigen::Vector4d upper(window.u_max_px, window.v_max_px, window.u_max_px, window.v_max_px);
  for (int i = 0; i < 4; ++i) {
    const char* name = end_names[static_cast<std::size_t>(i)];
    if (ends_px[i] < lower[i]) return bound_text("field of view: least", name, lower[i], ends_px[i]);
    if (ends_px[i] > upper[i]) return bound_text("field of view: largest", name, upper[i], ends_px[i]);
  }
  return std::nullopt;
}

// By any marker's image, whatever the camera: the third boundary lies between the two ends.
bool can_be_shown(const Eigen::Vector4d& features) {
  const double r_px = features[1], l_px = features[2], d_px = features[3];
  return features.allFinite() && r_px >= 0 && d_px > 0 && d_px < l_px;
}

std::string angle_text(double s_rad) {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(), "s_rad is %g, expected radians within 2 pi: it looks like degrees", s_rad);
  return text.data();
}

}  // namespace

std::optional<std::string> broken_limit(const ControllerConfig& config, const FeatureState& state,
                                        const Eigen::Vector4d& q, const Eigen::Vector4d& rate) {
  const DampedInverse inverse = damped_inverse(state.jacobian, config.scales, config.damping_threshold);
  if (inverse.min_singular_value < config.min_singular_value) return "the Jacobian is singular";
  if (auto broken = broken_joint_limit(config.limits, q, inverse.inverse * rate)) return broken;
  if (config.window) return outside_window(*config.window, state.ends_px);
  return std::nullopt;
}

std::string Infeasible::text() const {
  std::array<char, 64> begin{};
  std::snprintf(begin.data(), begin.size(), "can't be followed at %.2f s: ", time_s);
  return begin.data() + what;
}

std::optional<Infeasible> find_infeasible(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                                          const ControllerConfig& config, const Eigen::Vector4d& q_start,
                                          double step_s) {
  Eigen::Vector4d q = q_start;
  const auto steps = static_cast<long>(std::ceil(duration_s / step_s));
  for (long i = 0; i <= steps; ++i) {
    const double time_s = step_s * static_cast<double>(i);
    const DesiredFeatures desired = trajectory.at(time_s);
    if (std::abs(desired.features[0]) > two_pi) return Infeasible{time_s, angle_text(desired.features[0])};
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
