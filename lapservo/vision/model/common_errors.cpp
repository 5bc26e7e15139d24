#include "lapservo/vision/model/common_errors.h"

#include <cmath>
#include <cstddef>
#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

using Boundaries = std::array<double, 4>;
constexpr const UsualErrors& usual = usual_errors;

double median_sigma_px(std::span<const Measurement> measurements) {
  InplaceVector<double, 4 * EdgeMeasurements::max_lines> sigmas_px;
  for (const Measurement& m : measurements)
    if (m.group < 4) sigmas_px.push_back(m.sigma_px);
  return sigmas_px.empty() ? 0 : median(sigmas_px);
}

// The part of a blur beyond the usual.
double beyond_px2(double blur_px, double usual_px) {
  return std::max(0.0, blur_px * blur_px - usual_px * usual_px);
}

void add_boundaries(const EdgeBlur& blur, double radius_px, const std::optional<ProcessedEdges>& processed,
                    const Boundaries& bias_px, const Boundaries& departure_px, CommonErrors& errors) {
  const double unexplained = processed ? std::max(0.0, processed->misfit - usual.usual_misfit) : 0;
  const double unexplained_px = usual.px_per_misfit * unexplained;
  for (std::size_t k = 0; k < 4; ++k) {
    const bool corrected = processed && processed->bias_px[k];
    const double fraction = processed && processed->clips ? usual.fraction_of_clipped : usual.fraction_of_processing;
    const double left_px = (corrected ? fraction : 1) * bias_px[k];
    errors.px[k] = std::hypot(common_boundary_px(blur.along_px[k], radius_px),
                              std::hypot(left_px, unexplained_px, departure_px[k]));
  }
}

double beyond_usual_blur_px(const EdgeBlur& blur) {
  return std::max(0.0, blur.widest_px() - usual_blur_px);
}

// `moved_px`: by the camera's processing, boundaries; sides are moved, too, and nobody corrects that.
void add_sides(const EdgeBlur& blur, double radius_px, double moved_px, CommonErrors& errors) {
  const double side_px =
      usual.common_side_px + usual.side_of_blur * beyond_px2(blur.sides_px, usual.usual_side_blur_px) / radius_px;
  errors.px[4] = errors.px[5] = std::hypot(side_px, usual.side_fraction_of_processing * moved_px);
}

void add_patterns(const EdgeBlur& blur, double radius_px, double moved_px, CommonErrors& errors) {
  const double whole_px = usual.whole_fraction_of_blur * beyond_usual_blur_px(blur);
  const double leaning_px = usual.leaning_of_blur * beyond_px2(blur.widest_px(), usual_blur_px) / radius_px;
  errors.whole_px = std::hypot(whole_px, usual.whole_fraction_of_processing * moved_px);
  errors.leaning_px = std::hypot(leaning_px, usual.leaning_fraction_of_processing * moved_px);
  errors.bowed_px = usual.bowed_fraction_of_processing * moved_px;
}

// `moved_px`: by the camera's processing, root mean square of the boundaries; so much of it is uncertain.
PrintDoubt doubt_of(double sigma_px, const EdgeBlur& blur, double radius_px, double moved_px,
                    double doubted_of_processing) {
  const double beyond_usual_px = std::max(0.0, sigma_px - usual.usual_sigma_px), blur_px = beyond_usual_blur_px(blur);
  const double width_px = blur.boundaries_px();
  const double moved_or_noisy_px =
      std::hypot(usual.doubted_of_sigma * beyond_usual_px, doubted_of_processing * moved_px,
                 usual.doubted_boundary_of_radius * width_px * width_px / radius_px);
  return {std::hypot(moved_or_noisy_px, usual.doubted_boundary_of_blur * blur_px),
          std::hypot(moved_or_noisy_px, usual.doubted_tilt_of_blur * blur_px),
          std::hypot(usual.doubted_length_of_sigma * beyond_usual_px, usual.doubted_length_of_blur * blur_px)};
}

}  // namespace

double common_boundary_px(double blur_px, double radius_px) {
  return usual.boundary_of_blur * blur_px * blur_px / radius_px +
         usual.common_fraction_of_blur * std::max(0.0, blur_px - usual_blur_px);
}

double doubt_scale(double sigma_px, double blur_px, double bias_px) {
  return std::max(1.0, sigma_px / usual.usual_sigma_px) + std::max(0.0, blur_px - usual_blur_px) +
         bias_px / usual.doubted_processing_px;
}

CommonErrors common_errors(const EdgeMeasurements& pass, const ResidualLines& lines, const EdgeBlur& blur,
                           const std::optional<ProcessedEdges>& processed, const Boundaries& bias_px,
                           const Boundaries& departure_px) {
  CommonErrors errors;
  add_boundaries(blur, pass.radius_px, processed, bias_px, departure_px, errors);
  const double moved_px = std::sqrt(Eigen::Map<const Eigen::Array4d>(bias_px.data()).square().mean());
  add_sides(blur, pass.radius_px, moved_px, errors);
  add_patterns(blur, pass.radius_px, moved_px, errors);
  const double scatter = scatter_sigmas(pass.all, lines), sigma_px = median_sigma_px(pass.all);
  errors.boundary_noise_scale = std::max(usual.least_noise_scale, scatter);
  // Causes that scatter points beyond their noise move whole boundaries and sides, too.
  const double unmodelled = std::max(1.0, scatter);
  for (double& error_px : errors.px) error_px *= unmodelled;
  for (double* error_px : {&errors.whole_px, &errors.leaning_px, &errors.bowed_px}) *error_px *= unmodelled;
  errors.doubt = doubt_of(sigma_px, blur, pass.radius_px, moved_px, processed ? usual.doubted_of_processing : 1);
  return errors;
}

}  // namespace lapservo::internal
