#include "lapservo/calibration/registration/arm_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/fit/some_of.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

// By a quantile, so that a few wrong poses do not count and a part of the recording does.
Eigen::VectorXd noise_of(const Eigen::MatrixXd& residuals) {
  constexpr double part = 0.9, of_normal = 1.645;
  Eigen::VectorXd noise(residuals.rows());
  for (Eigen::Index channel = 0; channel < residuals.rows(); ++channel) {
    const Eigen::VectorXd sizes = residuals.row(channel).cwiseAbs();
    noise[channel] = quantile_of({sizes.begin(), sizes.end()}, part) / of_normal;
  }
  return noise;
}

// Sigmas of an arm's numbers: from the residuals' scatter, times this, but nowhere smaller than from the information
// alone: in directions that the motion leaves open, residuals scatter little.
Eigen::MatrixXd arm_covariance(const FrameFit& fit) {
  return covariance_at_least(unmodelled_sigmas * unmodelled_sigmas * fit.covariance, fit.independent);
}

// A width of half of what the joint travels, or more, is no gap: a width below 0 turns readings about their first one
// into twice as much, which is another fault.
bool is_backlash(const std::array<double, 4>& widths, const JointRanges& ranges) {
  for (std::size_t j = 0; j < 4; ++j)
    if (2 * std::abs(widths[j]) > ranges.travel(j)) return false;
  return true;
}

// Model and fit alone.
std::optional<ArmFit> fit_model(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                                const ArmFaults& free, const std::vector<JointFault>& held,
                                const AtIteration& at_iteration) {
  ArmFaults faults = free;
  faults.joints.insert(faults.joints.end(), held.begin(), held.end());
  ArmModel model(instrument, start, recording, faults);
  auto fit = fit_frames([&](const Eigen::VectorXd& x) { return model.residuals(x); }, model.unknowns(),
                        2 * poses_per_second(start.poses), at_iteration, held.size());
  if (!fit || !is_backlash(model.backlash_of(fit->x), start.ranges)) return std::nullopt;
  return ArmFit{std::move(model), std::move(*fit), {}, {}, {}};
}

// The noise that a fault leaves, and the fault in words.
struct Explanation {
  Eigen::VectorXd noise;
  std::string text;

  // A geometric mean: a fault that shows in some channels only is not hidden by the others.
  double left() const { return noise.array().log().mean(); }
};

class Explainer {
 public:
  Explainer(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
            const std::string& source, const AtIteration& at_iteration)
      : instrument_(instrument),
        poses_(some_of(poses, enough)),
        recording_(recording),
        source_(source),
        at_iteration_(at_iteration) {}

  // Whether there is a fit.
  bool try_fault(const JointFault& fault, double start_size) {
    JointRecording recording = recording_;
    const bool has_size = fault.step > 0;
    if (fault.mend && (!has_size || start_size != 0)) fault.mend(recording, start_size);
    if (!has_size && recording.joints == recording_.joints) return false;  // they do not have it
    ArmFaults free;
    if (has_size) free.joints.push_back(fault);
    const auto fitted = fit_to(fault.mend ? poses_ : with_focal(poses_, start_size), recording, free);
    if (!fitted) return false;
    const double more = has_size ? fitted->model.blocks().joints.of(fitted->fit.x)[0] : 0;
    const double size = (1 + start_size) * (1 + more) - 1;
    // Nearer to none than to where it started it is none: a joint that stood still moves by no scale.
    if (std::abs(size) < std::abs(size - start_size)) return false;
    add(*fitted, fault.text(size));
    return true;
  }

  // The noise of a fit without a fault.
  std::optional<Eigen::VectorXd> noise_without() const {
    const auto fitted = fit_to(poses_, recording_, {});
    return fitted ? std::optional(noise_of(fitted->fit.residuals)) : std::nullopt;
  }

  const std::optional<Explanation>& best() const { return best_; }

 private:
  static constexpr std::size_t enough = 120;  // poses: more of them explain nothing better

  std::optional<ArmFit> fit_to(const std::vector<TimedPose>& poses, const JointRecording& recording,
                               const ArmFaults& free) const {
    try {
      const ArmStart start = start_arm(instrument_, poses, recording, source_);
      if (!start.refusal.empty()) return std::nullopt;
      return fit_model(instrument_, start, recording, free, {}, at_iteration_);
    } catch (const InputError&) {  // a mended clock may leave no time in common
      return std::nullopt;
    }
  }

  void add(const ArmFit& fitted, std::string text) {
    Explanation explained{noise_of(fitted.fit.residuals), std::move(text)};
    if (!best_ || explained.left() < best_->left()) best_ = std::move(explained);
  }

  const Instrument& instrument_;
  std::vector<TimedPose> poses_;
  const JointRecording& recording_;
  const std::string& source_;
  const AtIteration& at_iteration_;
  std::optional<Explanation> best_;
};

// Faults to try: of those with a size, the ones that a fit without them sees; all where there is no such fit.
std::vector<JointFault> possible_faults(const Joints& joints, const std::vector<TimedPose>& poses, const ArmFit* fit) {
  std::vector<JointFault> faults = other_joint_faults(joints);
  const auto sized = sized_joint_faults(joints, poses);
  if (!fit) faults.insert(faults.end(), sized.begin(), sized.end());
  if (!fit) return faults;
  const Departures& departures = fit->fit.departures;
  for (const auto* seen : {&departures.seen, &departures.instead})
    for (const Fault& one : *seen) faults.push_back(sized[one.which]);
  return faults;
}

}  // namespace

std::optional<ArmFit> fit_arm(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                              const ArmFaults& free, const AtIteration& at_iteration) {
  auto faults = sized_joint_faults(instrument.joints.value(), start.poses);
  std::erase_if(faults, [&](const JointFault& held) {
    return std::ranges::any_of(free.joints, [&](const JointFault& fault) { return fault.text(0) == held.text(0); });
  });
  auto result = fit_model(instrument, start, recording, free, faults, at_iteration);
  if (!result) return std::nullopt;
  result->noise = noise_of(result->fit.residuals);
  result->covariance = arm_covariance(result->fit);
  const Departures& without = result->fit.departures;
  if (without.seen.empty()) return result;
  // To first order only: with those that are seen free, the fit shows by how much they put it off.
  ArmFaults with = free;
  for (const Fault& seen : without.seen) with.joints.push_back(faults[seen.which]);
  const auto without_bias = fit_model(instrument, start, recording, with, faults, at_iteration);
  if (!without_bias) return std::nullopt;
  const FrameFit& fit = without_bias->fit;
  const Eigen::Index numbers = result->fit.x.size(), joints = without_bias->model.blocks().joints.first;
  const Eigen::VectorXd bias = result->fit.x - fit.x.head(numbers);
  result->covariance = (arm_covariance(fit) + fit.departures.by_seen).topLeftCorner(numbers, numbers) +
                       bias * bias.transpose() + without.by_instead;
  for (std::size_t k = free.joints.size(); k < with.joints.size(); ++k) {
    const double size = fit.x[joints + static_cast<Eigen::Index>(k)];
    if (std::abs(size) > with.joints[k].least) result->faults.push_back(with.joints[k].text(size));
  }
  return result;
}

std::string explaining_fault(const Instrument& instrument, const std::vector<TimedPose>& poses,
                             const JointRecording& recording, const std::string& source, const ArmFit* fit,
                             const AtIteration& at_iteration) {
  if (poses.size() < min_registration_poses) return {};
  Explainer explainer(instrument, poses, recording, source, at_iteration);
  for (const JointFault& fault : possible_faults(instrument.joints.value(), poses, fit))
    for (const double start : fault.starts)
      if (explainer.try_fault(fault, start) && fault.is_linear) break;
  // It explains them when little is left by the images' noise or beside what there was, and much less somewhere.
  constexpr double most_left = 3, most_part_left = 1 / 3.0, least_gain = 1.5;
  const auto& best = explainer.best();
  if (!best) return {};
  const double left = best->noise.maxCoeff();
  const auto without = fit ? std::optional(fit->noise) : explainer.noise_without();
  const bool gains = !without || without->cwiseQuotient(best->noise).maxCoeff() > least_gain;
  const bool is_little = left < most_left || (fit && left < most_part_left * fit->noise.maxCoeff());
  return gains && is_little ? best->text : std::string();
}

}  // namespace lapservo::internal
