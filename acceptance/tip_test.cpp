// How well the tip is known: truth by kinematics of the test's own, on rendered frames, with rigs that are off as they
// say.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal::tip_test {

constexpr double degree = std::numbers::pi / 180;

// Where the marker's frame is, without lapservo's kinematics: Rz(theta) Ry(phi) Rz(psi + seam), rho along z.
Eigen::Isometry3d true_camera_from_marker(const Instrument& instrument, const JointVector& q) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translate(instrument.camera_from_rcm->translation).rotate(instrument.camera_from_rcm->rotation);
  pose.rotate(Eigen::AngleAxisd(q.theta_rad, Eigen::Vector3d::UnitZ()));
  pose.rotate(Eigen::AngleAxisd(q.phi_rad, Eigen::Vector3d::UnitY()));
  pose.rotate(Eigen::AngleAxisd(q.psi_rad + instrument.marker.seam_rad, Eigen::Vector3d::UnitZ()));
  return pose.translate(Eigen::Vector3d(0, 0, q.rho_m));
}

// A wrist as dVRK's needle driver has it: pitch about the base's y, then yaw about x turned with it, the tip beyond.
struct Wrist {
  double pitch_to_yaw_m = 0.0091, yaw_to_tip_m = 0.0102;
  Eigen::Vector3d tip_in_base(double pitch, double yaw) const {
    const Eigen::AngleAxisd by_pitch(pitch, Eigen::Vector3d::UnitY()), by_yaw(yaw, Eigen::Vector3d::UnitX());
    return by_pitch * (Eigen::Vector3d(0, 0, pitch_to_yaw_m) + by_yaw * Eigen::Vector3d(0, 0, yaw_to_tip_m));
  }
  Tool tool() const {
    constexpr double right = 90 * degree;
    Tool tool;
    tool.wrist = {{.name = "wrist_pitch", .alpha_rad = -right, .theta_rad = -right},
                  {.name = "wrist_yaw", .alpha_rad = -right, .a_m = pitch_to_yaw_m, .theta_rad = -right}};
    tool.last_from_tip.translation = {0, yaw_to_tip_m, 0};
    return tool;
  }
};

struct Errors {
  std::vector<Eigen::Vector3d> off_m, by_sigma;  // camera's axes
  int frames = 0;

  void add(const std::optional<Observation::Tip>& tip, const Eigen::Vector3d& truth) {
    ++frames;
    if (!tip) return;
    off_m.push_back(tip->camera_from_tip.translation - truth);
    by_sigma.push_back(off_m.back().cwiseQuotient(tip->covariance.diagonal().head<3>().cwiseSqrt()));
  }
  static Eigen::Vector3d rms(const std::vector<Eigen::Vector3d>& all) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& one : all) sum += one.cwiseAbs2();
    return (sum / static_cast<double>(all.size())).cwiseSqrt();
  }
  void print(const char* of) const {
    const Eigen::Vector3d mm = 1e3 * rms(off_m), sigmas = rms(by_sigma);
    std::printf("%s: %zu of %d; x %.3f y %.3f z %.3f mm rms; by sigma %.2f %.2f %.2f\n", of, off_m.size(), frames,
                mm.x(), mm.y(), mm.z(), sigmas.x(), sigmas.y(), sigmas.z());
  }
};

TEST(Tip, OfAWristIsOffAsItsCovarianceSays) {
  const Wrist wrist;
  Errors errors;
  double shaft = 0, place = 0, readings = 0;
  for (std::uint64_t seed = 101; seed <= 200; ++seed) {
    Random random(seed);
    const Rig truth = scenes::usual_rig();
    Rig rig = truth;
    scenes::misregister(rig.instruments[0], 1e-3 / std::sqrt(3), 5e-3 / std::sqrt(3), random);
    const double base_m = random.uniform(0.03, 0.05), azimuth_rad = random.uniform(-3, 3);
    const std::array<double, 2> joints{random.uniform(-1, 1), random.uniform(-1, 1)};
    Tool& tool = rig.instruments[0].tool.emplace(wrist.tool());
    Tool::Place& said = tool.place.emplace();
    said.covariance.diagonal().head<4>() << 2.5e-9, 2.5e-9, 1e-8, 1e-4;
    said.base_in_marker_m =
        Eigen::Vector3d(0, 0, base_m) + Eigen::Vector3d(5e-5, 5e-5, 1e-4).cwiseProduct(scenes::normal_vector(random));
    said.azimuth_rad = azimuth_rad + 0.01 * random.normal();
    const std::array<double, 2> read{joints[0] + degree * random.normal(), joints[1] + degree * random.normal()};
    const JointVector q = scenes::random_configuration(truth, 0, random);
    Tracker tracker(rig);
    tracker.set_wrist(0, read);
    const Observation seen = tracker.track(scenes::render(truth, {q}, seed))[0];
    const Eigen::Vector3d in_marker_m =
        Eigen::Vector3d(0, 0, base_m) +
        Eigen::AngleAxisd(azimuth_rad, Eigen::Vector3d::UnitZ()) * wrist.tip_in_base(joints[0], joints[1]);
    errors.add(seen.tip, true_camera_from_marker(truth.instruments[0], q) * in_marker_m);
    if (!seen.tip) continue;
    shaft += seen.tip->sigma_shaft_m, place += seen.tip->sigma_place_m, readings += seen.tip->sigma_readings_m;
  }
  errors.print("wrist");
  ASSERT_GE(errors.off_m.size(), 95u);
  const Eigen::Vector3d sigmas = Errors::rms(errors.by_sigma);
  EXPECT_GE(sigmas.minCoeff(), 0.7);
  EXPECT_LE(sigmas.maxCoeff(), 1.4);
  EXPECT_GT(readings, std::max(shaft, place)) << "the wrist is the largest part";
  EXPECT_GT(std::min(shaft, place), 0);
}

// The same frames with the tool in them and without.
TEST(Tip, AToolInTheImageDoesNotDisturbTheMarker) {
  const Wrist wrist;
  double with_squared = 0, without_squared = 0;
  int with_count = 0, without_count = 0;
  for (std::uint64_t seed = 301; seed <= 400; ++seed) {
    Random random(seed);
    const Rig rig = scenes::usual_rig();
    const Instrument& instrument = rig.instruments[0];
    const JointVector q = scenes::random_configuration(rig, 0, random);
    ShaftPlacement placement = placement_of(instrument, q, {random.uniform(-1, 1), random.uniform(-1, 1)});
    Tool tool = wrist.tool();
    tool.place.emplace().base_in_marker_m.z() = instrument.marker.length_m() + random.uniform(0.005, 0.02);
    tool.place->azimuth_rad = random.uniform(-3, 3);
    Instrument with = instrument;
    with.tool = tool;
    const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, seed);
    const auto add = [&](const ShaftModel& shaft, double& squared, int& count) {
      const cv::Mat image = Renderer(rig.camera, {shaft}, tissue).render({placement}, seed);
      const Observation seen = Tracker(rig).track(image)[0];
      if (seen.status != Status::ok || !seen.rcm) return;
      const double off_rad = std::remainder(seen.rcm->q.psi_rad - q.psi_rad, 2 * std::numbers::pi);
      squared += off_rad * off_rad, ++count;
    };
    add(shaft_of(with), with_squared, with_count);
    add(shaft_of(instrument), without_squared, without_count);
  }
  const double with_rad = std::sqrt(with_squared / with_count),
               without_rad = std::sqrt(without_squared / without_count);
  std::printf("psi with a tool: %d frames, %.2f mrad rms; without: %d, %.2f mrad\n", with_count, 1e3 * with_rad,
              without_count, 1e3 * without_rad);
  EXPECT_GE(with_count, without_count - 1);
  EXPECT_LE(with_rad, 1.1 * without_rad);
}

}  // namespace lapservo::internal::tip_test
