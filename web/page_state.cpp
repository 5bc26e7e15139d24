#include "web/page_state.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include "lapservo/core/joint_vector.h"
#include "lapservo/kinematics/feature_map.h"
#include "web/live_page.h"

namespace lapservo::internal {
namespace {

using json = nlohmann::ordered_json;

json number(double value, double sigma) {
  return {{"value", value}, {"sigma", sigma}};
}

json joints_of(const Observation::Rcm& rcm) {
  const Eigen::Vector4d q = rcm.q.vector();
  json joints = json::object();
  for (std::size_t k = 0; k < JointVector::size; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    joints[std::string(JointVector::names[k])] = number(q[i], std::sqrt(rcm.covariance(i, i)));
  }
  return joints;
}

json features_of(const Features& features) {
  return {{"s_rad", features.s_rad},
          {"r_px", features.r_px ? json(*features.r_px) : json()},
          {"l_px", features.l_px},
          {"d_px", features.d_px}};
}

}  // namespace

json json_of(const std::vector<Observation>& observations, std::optional<double> silent_s) {
  json instruments = json::array();
  for (const Observation& seen : observations) {
    if (silent_s) {
      instruments.push_back({{"name", seen.instrument}, {"status", fmt::format("no image for {:.0f} s", *silent_s)}});
      continue;
    }
    json one{{"name", seen.instrument}, {"status", to_string(seen.status)}};
    if (seen.status == Status::ok) {
      one["tau_rad"] = number(seen.tau_rad, seen.sigma_tau_rad);
      one["features"] = features_of(seen.features);
      if (seen.rcm) one["q"] = joints_of(*seen.rcm);
    }
    instruments.push_back(std::move(one));
  }
  return instruments;
}

json json_of(const PageLoop& loop) {
  const auto four = [](const std::optional<Eigen::Vector4d>& values, Eigen::Index i) {
    return values ? json((*values)[i]) : json();
  };
  json features = json::array();
  for (std::size_t k = 0; k < FeatureVector::size; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    features.push_back({{"name", FeatureVector::names[k]},
                        {"measured", four(loop.features, i)},
                        {"desired", four(loop.desired, i)},
                        {"error", four(loop.error, i)}});
  }
  return {{"time_s", loop.time_s},       {"delay_s", loop.delay_s}, {"limited", loop.limited},
          {"can_start", loop.can_start}, {"answer", loop.answer},   {"features", features}};
}

std::string text_of(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace lapservo::internal
