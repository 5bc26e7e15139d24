#include "lapservo/control/newton_inverse.h"

#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {

std::optional<NewtonInverse> newton_inverse(const FeatureModel& model, const Eigen::Vector4d& target,
                                            const Eigen::Vector4d& guess, const Scales& scales) {
  constexpr int max_iterations = 30;
  constexpr double tolerance = 1e-6;  // in feature scales
  constexpr double longest_step = 2;  // in joint scales: stay where the linear model means something
  constexpr double shortest_step = 1e-3;
  auto state = model(guess);
  if (!state) return std::nullopt;
  const auto size = [&](const Eigen::Vector4d& residual) { return residual.cwiseQuotient(scales.features).norm(); };

  NewtonInverse best{guess, feature_error(target, state->features), false};
  for (int iteration = 0;; ++iteration) {
    best.converged = size(best.residual) < tolerance;
    if (best.converged || iteration == max_iterations) return best;
    Eigen::Vector4d step = damped_inverse(state->jacobian, scales).inverse * best.residual;
    const double length = step.cwiseQuotient(scales.joints).norm();
    if (length > longest_step) step *= longest_step / length;
    double fraction = 1;
    for (;; fraction /= 2) {
      if (fraction < shortest_step) return best;
      const Eigen::Vector4d q = best.q + fraction * step;
      const auto next = model(q);
      if (!next) continue;
      const Eigen::Vector4d residual = feature_error(target, next->features);
      if (!(size(residual) < size(best.residual))) continue;
      state = next;
      best = {q, residual, false};
      break;
    }
  }
}

}  // namespace lapservo::internal
