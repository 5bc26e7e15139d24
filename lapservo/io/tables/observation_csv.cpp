#include "lapservo/io/tables/observation_csv.h"

#include <cmath>
#include <optional>
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
  void add_sigma(std::optional<double> value) { add(value, of_sigma); }
  std::vector<ObservationNumber> all() && { return std::move(all_); }

 private:
  bool known_;
  std::vector<ObservationNumber> all_;
};

void add_marker(Numbers& numbers, const std::optional<Observation::MarkerPose>& marker) {
  const auto of_marker = [&](auto get) { return marker ? std::optional<double>(get(*marker)) : std::nullopt; };
  for (Eigen::Index i = 0; i < 3; ++i)
    numbers.add(of_marker([&](const auto& m) { return m.camera_from_marker.translation[i]; }), 8);
  for (Eigen::Index i = 0; i < 4; ++i)  // x y z w
    numbers.add(of_marker([&](const auto& m) { return m.camera_from_marker.rotation.coeffs()[i]; }), 8);
  numbers.add_sigma(of_marker([](const auto& m) { return m.sigma_xy_m; }));
  numbers.add_sigma(of_marker([](const auto& m) { return m.sigma_z_m; }));
  numbers.add_sigma(of_marker([](const auto& m) { return m.sigma_axis_rad; }));
  numbers.add_sigma(of_marker([](const auto& m) { return m.sigma_roll_rad; }));
}

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
  const auto& rcm = observation.rcm;
  const auto of_q = [&](auto get) { return rcm ? std::optional<double>(get(*rcm)) : std::nullopt; };
  numbers.add(of_q([](const auto& r) { return r.q.theta_rad; }), 7);
  numbers.add(of_q([](const auto& r) { return r.q.phi_rad; }), 7);
  numbers.add(of_q([](const auto& r) { return r.q.rho_m; }), 8);
  numbers.add(of_q([](const auto& r) { return r.q.psi_rad; }), 7);
  numbers.add(observation.tau_rad, 7);
  for (Eigen::Index i = 0; i < 4; ++i)
    numbers.add_sigma(of_q([&](const auto& r) { return std::sqrt(r.covariance(i, i)); }));
  numbers.add_sigma(observation.sigma_tau_rad);
  for (const Eigen::Vector2d& edge : observation.edges_raw_px) numbers.add(edge.x(), 4), numbers.add(edge.y(), 4);
  const Features& f = observation.features;
  numbers.add(f.s_rad, 7);
  numbers.add(f.r_px, 4);
  numbers.add(f.l_px, 4);
  numbers.add(f.d_px, 4);
  numbers.add(f.cross_ratio, 7);
  add_marker(numbers, observation.marker);
  numbers.add_sigma(rcm ? observation.p_false : std::nullopt);
  const auto of_tip = [&](auto get) {
    return observation.tip ? std::optional<double>(get(*observation.tip)) : std::nullopt;
  };
  for (Eigen::Index i = 0; i < 3; ++i)
    numbers.add(of_tip([&](const auto& tip) { return tip.camera_from_tip.translation[i]; }), 8);
  for (Eigen::Index i = 0; i < 3; ++i)
    numbers.add_sigma(of_tip([&](const auto& tip) { return std::sqrt(tip.covariance(i, i)); }));
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

ObservationCsv::ObservationCsv(const std::filesystem::path& path) : file_(path, observation_csv_header) {}

void ObservationCsv::add(int frame, double time_s, const std::string& file, const Observation& observation) {
  file_.add(observation_csv_row(frame, time_s, file, observation));
}

}  // namespace lapservo::internal
