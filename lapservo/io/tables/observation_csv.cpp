#include "lapservo/io/tables/observation_csv.h"

#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/csv.h"

namespace lapservo::internal {
namespace {

constexpr int of_sigma = -1;

// The columns after `status`, in their order.
class Numbers {
 public:
  explicit Numbers(const Observation& observation) : known_(observation.status == Status::ok) {}
  void add(std::optional<double> value, int decimals) {
    if (!known_ || (value && !std::isfinite(*value))) value.reset();
    all_.push_back({value, decimals});
  }
  /// `get` of `from`, where that is known.
  void add(int decimals, const auto& from, const auto& get) {
    add(from ? std::optional<double>(get(*from)) : std::nullopt, decimals);
  }
  /// The same for each of `count`.
  void add_each(Eigen::Index count, int decimals, const auto& from, const auto& get) {
    for (Eigen::Index i = 0; i < count; ++i) add(decimals, from, [&](const auto& it) { return get(it, i); });
  }
  std::vector<ObservationNumber> all() && { return std::move(all_); }

 private:
  bool known_;
  std::vector<ObservationNumber> all_;
};

}  // namespace

const char* const observation_csv_header =
    "frame,time_s,file,instrument,status,"
    "theta_rad,phi_rad,rho_m,psi_rad,tau_rad,"
    "sigma_theta_rad,sigma_phi_rad,sigma_rho_m,sigma_psi_rad,sigma_tau_rad,"
    "e0_u_px,e0_v_px,e1_u_px,e1_v_px,e2_u_px,e2_v_px,e3_u_px,e3_v_px,"
    "s_rad,r_px,l_px,d_px,cross_ratio,"
    "marker_x_m,marker_y_m,marker_z_m,marker_qx,marker_qy,marker_qz,marker_qw,"
    "sigma_marker_xy_m,sigma_marker_z_m,sigma_axis_rad,sigma_roll_rad,p_false,"
    "tip_x_m,tip_y_m,tip_z_m,sigma_tip_x_m,sigma_tip_y_m,sigma_tip_z_m";

std::vector<ObservationNumber> observation_numbers(const Observation& observation) {
  Numbers numbers(observation);
  const auto& [rcm, marker, tip] = std::tie(observation.rcm, observation.marker, observation.tip);
  const auto root = [](const auto& of, Eigen::Index i) { return std::sqrt(of.covariance(i, i)); };
  numbers.add(7, rcm, [](const auto& r) { return r.q.theta_rad; });
  numbers.add(7, rcm, [](const auto& r) { return r.q.phi_rad; });
  numbers.add(8, rcm, [](const auto& r) { return r.q.rho_m; });
  numbers.add(7, rcm, [](const auto& r) { return r.q.psi_rad; });
  numbers.add(observation.tau_rad, 7);
  numbers.add_each(4, of_sigma, rcm, root);
  numbers.add(observation.sigma_tau_rad, of_sigma);
  for (const Eigen::Vector2d& edge : observation.edges_raw_px) numbers.add(edge.x(), 4), numbers.add(edge.y(), 4);
  const Features& f = observation.features;
  numbers.add(f.s_rad, 7);
  numbers.add(f.r_px, 4);
  numbers.add(f.l_px, 4);
  numbers.add(f.d_px, 4);
  numbers.add(f.cross_ratio, 7);
  numbers.add_each(3, 8, marker, [](const auto& m, auto i) { return m.camera_from_marker.translation[i]; });
  numbers.add_each(4, 8, marker, [](const auto& m, auto i) { return m.camera_from_marker.rotation.coeffs()[i]; });
  numbers.add(of_sigma, marker, [](const auto& m) { return m.sigma_xy_m; });
  numbers.add(of_sigma, marker, [](const auto& m) { return m.sigma_z_m; });
  numbers.add(of_sigma, marker, [](const auto& m) { return m.sigma_axis_rad; });
  numbers.add(of_sigma, marker, [](const auto& m) { return m.sigma_roll_rad; });
  numbers.add(rcm ? observation.p_false : std::nullopt, of_sigma);
  numbers.add_each(3, 8, tip, [](const auto& t, auto i) { return t.camera_from_tip.translation[i]; });
  numbers.add_each(3, of_sigma, tip, root);
  return std::move(numbers).all();
}

std::string observation_csv_row(int frame, double time_s, const std::string& file, const Observation& observation) {
  std::string row = fmt::format("{},{:.6f},{},{},{}", frame, time_s, csv_field(file), csv_field(observation.instrument),
                                to_string(observation.status));
  for (const auto& [value, decimals] : observation_numbers(observation)) {
    row += ',';
    if (value) row += decimals == of_sigma ? fmt::format("{:.4g}", *value) : fmt::format("{:.{}f}", *value, decimals);
  }
  return row;
}

}  // namespace lapservo::internal
