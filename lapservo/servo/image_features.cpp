#include "lapservo/servo/image_features.h"

#include <cstddef>

#include "lapservo/kinematics/feature_map.h"

namespace lapservo {
using namespace internal;
namespace {

// Of features whose fit had no configuration to carry its covariance over: s_rad, r_px, l_px, d_px.
const Eigen::Vector4d usual_sigma(5e-4, 0.15, 0.15, 0.15);
// What the fit's covariance does not know: the lens, the print, the registration.
const Eigen::Vector4d least_sigma(5e-5, 0.02, 0.02, 0.02);

Eigen::Vector4d both_ends(const Eigen::Vector2d& first, const Eigen::Vector2d& last) {
  Eigen::Vector4d ends;
  ends << first, last;
  return ends;
}

}  // namespace

FeatureModel feature_model(const Rig& rig) {
  const Instrument& instrument = rig.instruments.at(0);
  if (!instrument.camera_from_rcm) return {};
  const ImageModel image{rig.camera, instrument.marker, *instrument.camera_from_rcm};
  return [image](const Eigen::Vector4d& q) -> std::optional<FeatureState> {
    const auto [reason, point] = feature_map(image, RcmCoordinates::from_vector(q));
    if (!point) return std::nullopt;
    FeatureState state;
    state.features = point->f;
    state.jacobian = point->jacobian;
    state.ends_px = both_ends(point->ideal_px[0], point->ideal_px[3]);
    state.ends_jacobian = point->ends_jacobian;
    return state;
  };
}

ImageMeasurement measurement_of(const Observation& observation, const FeatureModel& model, double stamp_s,
                                const std::optional<Eigen::Vector2d>& rcm_px) {
  ImageMeasurement measurement;
  measurement.time_s = stamp_s;
  std::optional<double> r_px = observation.features.r_px;
  if (!r_px && rcm_px) r_px = (observation.edges_ideal_px[0] - *rcm_px).norm();
  measurement.found = observation.status == Status::ok && r_px;
  if (!measurement.found) return measurement;
  const Features& f = observation.features;
  measurement.features << f.s_rad, *r_px, f.l_px, f.d_px;
  measurement.ends_px = both_ends(observation.edges_ideal_px[0], observation.edges_ideal_px[3]);
  measurement.covariance = usual_sigma.cwiseAbs2().asDiagonal();
  if (!observation.rcm) return measurement;
  measurement.q = observation.rcm->q.vector();
  if (const auto state = model ? model(*measurement.q) : std::nullopt) {
    measurement.covariance = feature_covariance(*state, observation.rcm->covariance);
    measurement.covariance += least_sigma.cwiseAbs2().asDiagonal();
    // Symmetric to the last bit: a log holds one half of it.
    measurement.covariance = (0.5 * (measurement.covariance + measurement.covariance.transpose())).eval();
  }
  return measurement;
}

}  // namespace lapservo
