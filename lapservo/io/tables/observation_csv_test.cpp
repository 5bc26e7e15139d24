#include "lapservo/io/tables/observation_csv.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::observation_csv_test {

constexpr std::uint64_t seed = 59;

Observation random_observation(Random& random) {
  Observation o;
  o.instrument = "PSM \"1\", left";
  o.status = Status::ok;
  o.rcm = Observation::Rcm{};
  o.rcm->q = {random.uniform(-pi, pi), random.uniform(0, pi), random.uniform(0.05, 0.2), random.uniform(-pi, pi)};
  for (Eigen::Index i = 0; i < 4; ++i) o.rcm->covariance(i, i) = std::pow(10.0, random.uniform(-12, -4));
  o.marker = Observation::MarkerPose{};
  o.marker->camera_from_marker = {Eigen::Quaterniond(0.5, 0.1, -0.7, 0.5).normalized(),
                                  {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.05, 0.2)}};
  o.marker->sigma_xy_m = 1e-5, o.marker->sigma_z_m = 2e-4, o.marker->sigma_axis_rad = 3e-4;
  o.marker->sigma_roll_rad = 4e-4;
  o.p_false = 5e-5;
  o.tip = Observation::Tip{};
  Observation::Tip& tip = *o.tip;
  tip.camera_from_tip.translation = {random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(0.05, 0.2)};
  for (Eigen::Index i = 0; i < 3; ++i) tip.covariance(i, i) = std::pow(10.0, random.uniform(-10, -6));
  o.tau_rad = random.uniform(0, two_pi);
  o.sigma_tau_rad = std::pow(10.0, random.uniform(-6, -2));
  for (std::size_t k = 0; k < 4; ++k) {
    o.edges_raw_px[k] = {random.uniform(0, 1280), random.uniform(0, 720)};
    o.edges_ideal_px[k] = {random.uniform(0, 1280), random.uniform(0, 720)};
  }
  o.features = {random.uniform(-pi, pi), random.uniform(0, 2000), random.uniform(50, 400), random.uniform(20, 300),
                random.uniform(1, 2)};
  return o;
}

CsvTable table_of(const std::vector<std::string>& rows) {
  std::string text = observation_csv_header;
  for (const std::string& row : rows) text.append("\n").append(row);
  return CsvTable::parse(text, "obs.csv");
}

CsvTable table_of(const Observation& observation) {
  return table_of({observation_csv_row(3, 0.1, "left, \"new\".png", observation)});
}

// docs/output.md, in this order.
TEST(ObservationCsv, HasTheColumnsOfTheConventions) {
  EXPECT_EQ(std::string(observation_csv_header),
            "frame,time_s,file,instrument,status,"
            "theta_rad,phi_rad,rho_m,psi_rad,tau_rad,"
            "sigma_theta_rad,sigma_phi_rad,sigma_rho_m,sigma_psi_rad,sigma_tau_rad,"
            "e0_u_px,e0_v_px,e1_u_px,e1_v_px,e2_u_px,e2_v_px,e3_u_px,e3_v_px,"
            "s_rad,r_px,l_px,d_px,cross_ratio,"
            "marker_x_m,marker_y_m,marker_z_m,marker_qx,marker_qy,marker_qz,marker_qw,"
            "sigma_marker_xy_m,sigma_marker_z_m,sigma_axis_rad,sigma_roll_rad,p_false,"
            "tip_x_m,tip_y_m,tip_z_m,sigma_tip_x_m,sigma_tip_y_m,sigma_tip_z_m");
}

TEST(ObservationCsv, NumbersComeBackFarFinerThanTheyAreKnown) {
  Random random(seed);
  for (int i = 0; i < 200; ++i) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Observation o = random_observation(random);
    const CsvTable table = table_of(o);
    for (const auto& [column, text] : {std::pair("frame", "3"),
                                       {"file", "left, \"new\".png"},
                                       {"instrument", o.instrument.c_str()},
                                       {"status", "ok"}})
      EXPECT_EQ(table.text(0, column), text);
    EXPECT_EQ(table.number(0, "time_s"), 0.1);
    const auto expect = [&](const std::string& column, double expected, double within) {
      EXPECT_NEAR(table.number(0, column), expected, within) << column;
    };
    const char* const names[] = {"theta_rad", "phi_rad", "rho_m", "psi_rad"};
    for (Eigen::Index k = 0; k < 4; ++k) {
      const double sigma = std::sqrt(o.rcm->covariance(k, k));
      expect(names[k], o.rcm->q.vector()[k], k == 2 ? 1e-8 : 1e-7);
      expect(std::string("sigma_") + names[k], sigma, 1e-3 * sigma);
    }
    expect("tau_rad", o.tau_rad, 1e-7), expect("sigma_tau_rad", o.sigma_tau_rad, 1e-3 * o.sigma_tau_rad);
    for (std::size_t k = 0; k < 4; ++k) {  // raw pixels, for drawing
      const std::string edge = std::string("e").append(std::to_string(k));
      expect(edge + "_u_px", o.edges_raw_px[k].x(), 1e-4), expect(edge + "_v_px", o.edges_raw_px[k].y(), 1e-4);
    }
    expect("s_rad", o.features.s_rad, 1e-7), expect("r_px", o.features.r_px.value(), 1e-4);
    expect("l_px", o.features.l_px, 1e-4), expect("d_px", o.features.d_px, 1e-4);
    expect("cross_ratio", o.features.cross_ratio, 1e-7);
    const Rigid3& pose = o.marker->camera_from_marker;
    for (int k = 0; k < 4; ++k) expect(std::string("marker_q") + "xyzw"[k], pose.rotation.coeffs()[k], 1e-8);
    expect("sigma_marker_xy_m", 1e-5, 1e-8), expect("sigma_marker_z_m", 2e-4, 1e-7);
    expect("sigma_axis_rad", 3e-4, 1e-7), expect("sigma_roll_rad", 4e-4, 1e-7);
    expect("p_false", 5e-5, 1e-8);
    for (int k = 0; k < 3; ++k) {
      const std::string axis = std::string(1, "xyz"[k]) + "_m";
      const double sigma_tip_m = std::sqrt(o.tip->covariance(k, k));
      expect("marker_" + axis, pose.translation[k], 1e-8);
      expect("tip_" + axis, o.tip->camera_from_tip.translation[k], 1e-8);
      expect("sigma_tip_" + axis, sigma_tip_m, 1e-3 * sigma_tip_m);
    }
  }
}

std::vector<std::string> empty_columns(const CsvTable& table) {
  std::vector<std::string> empty;
  for (const std::string& column : table.columns())
    if (table.text(0, column).empty()) empty.push_back(column);
  return empty;
}

TEST(ObservationCsv, ColumnsOfWhatIsNotThereOrNotFiniteAreEmpty) {
  Random random(seed);
  Observation unregistered = random_observation(random), without_pose = unregistered, without_tip = unregistered;
  Observation not_finite = unregistered;
  unregistered.rcm.reset(), unregistered.features.r_px.reset();
  without_pose.marker.reset();
  without_tip.tip.reset();
  not_finite.rcm->q.psi_rad = std::nan("");
  not_finite.rcm->covariance(1, 1) = -1;  // whose root is NaN
  not_finite.sigma_tau_rad = std::numeric_limits<double>::infinity();
  not_finite.edges_raw_px[2].y() = std::nan("");
  EXPECT_EQ(empty_columns(table_of(unregistered)),
            (std::vector<std::string>{"theta_rad", "phi_rad", "rho_m", "psi_rad", "sigma_theta_rad", "sigma_phi_rad",
                                      "sigma_rho_m", "sigma_psi_rad", "r_px", "p_false"}));
  EXPECT_EQ(empty_columns(table_of(without_pose)).size(), 11U);
  EXPECT_EQ(
      empty_columns(table_of(without_tip)),
      (std::vector<std::string>{"tip_x_m", "tip_y_m", "tip_z_m", "sigma_tip_x_m", "sigma_tip_y_m", "sigma_tip_z_m"}));
  EXPECT_EQ(empty_columns(table_of(not_finite)),
            (std::vector<std::string>{"psi_rad", "sigma_phi_rad", "sigma_tau_rad", "e2_v_px"}));
}

TEST(ObservationCsv, WithoutAnObservationEveryMeasurementIsEmpty) {
  Random random(seed);
  for (const Status status : {Status::no_marker, Status::cut, Status::occluded, Status::ambiguous, Status::poor_fit,
                              Status::uncertain, Status::marker_mismatch, Status::interlaced}) {
    Observation o = random_observation(random);
    o.status = status;
    const CsvTable table = table_of(o);
    EXPECT_EQ(table.text(0, "status"), to_string(status));
    EXPECT_EQ(table.text(0, "instrument"), o.instrument);
    EXPECT_EQ(empty_columns(table).size(), 41U) << to_string(status);
  }
}

}  // namespace lapservo::internal::observation_csv_test
