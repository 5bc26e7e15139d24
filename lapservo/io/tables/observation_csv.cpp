#include "lapservo/io/tables/observation_csv.h"

#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "lapservo/core/csv.h"

namespace lapservo::internal {
namespace {

void append(std::string& row, std::optional<double> value, int decimals) {
  row += ',';
  if (value && std::isfinite(*value)) row += fmt::format("{:.{}f}", *value, decimals);
}

void append_sigma(std::string& row, std::optional<double> value) {
  row += ',';
  if (value && std::isfinite(*value)) row += fmt::format("{:.4g}", *value);
}

void append_marker(std::string& row, const std::optional<Observation::MarkerPose>& marker) {
  const auto of_marker = [&](auto get) { return marker ? std::optional<double>(get(*marker)) : std::nullopt; };
  for (Eigen::Index i = 0; i < 3; ++i)
    append(row, of_marker([&](const auto& m) { return m.camera_from_marker.translation[i]; }), 8);
  for (Eigen::Index i = 0; i < 4; ++i)  // x y z w
    append(row, of_marker([&](const auto& m) { return m.camera_from_marker.rotation.coeffs()[i]; }), 8);
  append_sigma(row, of_marker([](const auto& m) { return m.sigma_xy_m; }));
  append_sigma(row, of_marker([](const auto& m) { return m.sigma_z_m; }));
  append_sigma(row, of_marker([](const auto& m) { return m.sigma_axis_rad; }));
  append_sigma(row, of_marker([](const auto& m) { return m.sigma_roll_rad; }));
}

constexpr std::size_t measured_columns = 34;

}  // namespace

const char* const observation_csv_header =
    "frame,time_s,file,instrument,status,"
    "theta_rad,phi_rad,rho_m,psi_rad,tau_rad,"
    "sigma_theta_rad,sigma_phi_rad,sigma_rho_m,sigma_psi_rad,sigma_tau_rad,"
    "e0_u_px,e0_v_px,e1_u_px,e1_v_px,e2_u_px,e2_v_px,e3_u_px,e3_v_px,"
    "s_rad,r_px,l_px,d_px,cross_ratio,"
    "marker_x_m,marker_y_m,marker_z_m,marker_qx,marker_qy,marker_qz,marker_qw,"
    "sigma_marker_xy_m,sigma_marker_z_m,sigma_axis_rad,sigma_roll_rad";

std::string observation_csv_row(int frame, double time_s, const std::string& file, const Observation& observation) {
  std::string row = fmt::format("{},{:.6f},{},{},{}", frame, time_s, csv_field(file), csv_field(observation.instrument),
                                to_string(observation.status));
  if (observation.status != Status::ok) return row.append(measured_columns, ',');
  const auto& rcm = observation.rcm;
  const auto of_q = [&](auto get) { return rcm ? std::optional<double>(get(*rcm)) : std::nullopt; };
  append(row, of_q([](const auto& r) { return r.q.theta_rad; }), 7);
  append(row, of_q([](const auto& r) { return r.q.phi_rad; }), 7);
  append(row, of_q([](const auto& r) { return r.q.rho_m; }), 8);
  append(row, of_q([](const auto& r) { return r.q.psi_rad; }), 7);
  append(row, observation.tau_rad, 7);
  for (Eigen::Index i = 0; i < 4; ++i)
    append_sigma(row, of_q([&](const auto& r) { return std::sqrt(r.covariance(i, i)); }));
  append_sigma(row, observation.sigma_tau_rad);
  for (const Eigen::Vector2d& edge : observation.edges_raw_px) append(row, edge.x(), 4), append(row, edge.y(), 4);
  const Features& f = observation.features;
  append(row, f.s_rad, 7);
  append(row, f.r_px, 4);
  append(row, f.l_px, 4);
  append(row, f.d_px, 4);
  append(row, f.cross_ratio, 7);
  append_marker(row, observation.marker);
  return row;
}

ObservationCsv::ObservationCsv(const std::filesystem::path& path) : file_(path, observation_csv_header) {}

void ObservationCsv::add(int frame, double time_s, const std::string& file, const Observation& observation) {
  file_.add(observation_csv_row(frame, time_s, file, observation));
}

}  // namespace lapservo::internal
