// Standard deviations are whole: over frames and over rigs that are drawn from the sigmas which the rig file holds, the
// errors of an observation, divided by its sigmas, have unit spread. LAPSERVO_SIGMA_FRAMES and LAPSERVO_SIGMA_SEED set
// the number of frames of each row (40) and the first seed. Each test prints its rows.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "acceptance/laboratory.h"
#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/registration/registration.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/testing/environment.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::acceptance::rig_sigmas_test {
using namespace internal;

using testing::seeds_from_environment;

// Sums of squared errors over variances, by quantity.
class Spread {
 public:
  explicit Spread(std::vector<std::string> names) : names_(std::move(names)), squares_(names_.size()) {}

  void add(std::size_t i, double error, double sigma) { squares_[i].push_back(std::pow(error / sigma, 2)); }
  double of(std::size_t i) const {
    double sum = 0;
    for (const double square : squares_[i]) sum += square;
    return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, squares_[i].size())));
  }
  double worst() const {
    double most = 0;
    for (const auto& squares : squares_)
      for (const double square : squares) most = std::max(most, std::sqrt(square));
    return most;
  }
  void print(const std::string& row, int told, int frames) const {
    std::printf("  %-34s found %d of %d; error / sigma:", row.c_str(), told, frames);
    for (std::size_t i = 0; i < names_.size(); ++i) std::printf(" %s %.2f", names_[i].c_str(), of(i));
    std::printf("; worst %.1f\n", worst());
  }
  void expect(double least, double most) const {
    for (std::size_t i = 0; i < names_.size(); ++i) {
      EXPECT_GT(of(i), least) << names_[i];
      EXPECT_LT(of(i), most) << names_[i];
    }
  }

 private:
  std::vector<std::string> names_;
  std::vector<std::vector<double>> squares_;
};

// Errors of q, and of the marker's pose: across and along the line of sight, of the axis and about it.
struct Row {
  int frames = 0, told = 0;
  Spread q{{"theta", "phi", "rho", "psi"}}, pose{{"x y", "z", "axis", "roll"}};

  void add(const Observation& seen, const Instrument& truth, const JointVector& true_q) {
    ++told;
    if (seen.rcm) {
      Eigen::Vector4d error = seen.rcm->q.vector() - true_q.vector();
      for (const Eigen::Index angle : {0, 1, 3}) error[angle] = wrap_pi(error[angle]);
      for (Eigen::Index i = 0; i < 4; ++i)
        q.add(static_cast<std::size_t>(i), error[i], std::sqrt(seen.rcm->covariance(i, i)));
    }
    const Observation::MarkerPose& marker = seen.marker.value();
    const Rigid3 expected = camera_from_marker(truth.marker, *truth.camera_from_rcm, true_q);
    const Eigen::Matrix3d turn =
        (expected.rotation.conjugate() * marker.camera_from_marker.rotation).toRotationMatrix();
    const Eigen::Vector3d moved_m = marker.camera_from_marker.translation - expected.translation;
    pose.add(0, moved_m.head<2>().norm() / std::sqrt(2.0), marker.sigma_xy_m);
    pose.add(1, moved_m.z(), marker.sigma_z_m);
    pose.add(2, turn.col(2).head<2>().norm(), marker.sigma_axis_rad);
    pose.add(3, std::atan2(turn(1, 0), turn(0, 0)), marker.sigma_roll_rad);
  }
};

// Frames of rendered scenes of the rig, each tracked by itself with a rig that is drawn about it.
Row tracked(const Rig& truth, const std::function<Rig(Rig, Random&)>& drawn) {
  Row row;
  for (const std::uint64_t seed : seeds_from_environment("LAPSERVO_SIGMA_FRAMES", "LAPSERVO_SIGMA_SEED", 40)) {
    ++row.frames;
    Random random(seed);
    const JointVector q = scenes::random_configuration(truth, 0, random);
    const cv::Mat image = scenes::render(truth, {q}, seed);
    const Rig rig = drawn(truth, random);
    const Observation seen = Tracker(rig).track(image)[0];
    if (seen.status == Status::ok && seen.rcm.has_value() == rig.instruments[0].camera_from_rcm.has_value())
      row.add(seen, truth.instruments[0], q);
  }
  return row;
}

TEST(RigSigmas, OfARegistrationAreInQ) {
  for (const auto& [sigma_mm, sigma_mrad] :
       {std::pair(0.3, 1.0), std::pair(1.0, 5.0), std::pair(3.0, 20.0), std::pair(10.0, 50.0)}) {
    const Row row = tracked(testing::paper_test_rig(), [mm = sigma_mm, mrad = sigma_mrad](Rig rig, Random& random) {
      scenes::misregister(rig.instruments[0], 1e-3 * mm, 1e-3 * mrad, random);
      return rig;
    });
    const std::string name = fmt::format("registration to {:.1f} mm, {:.0f} mrad", sigma_mm, sigma_mrad);
    row.q.print(name, row.told, row.frames);
    EXPECT_GE(row.told, 0.95 * row.frames) << name;
    row.q.expect(0.7, 1.3);
  }
}

// A print whose boundaries are known to so much at either edge: those of the rig are drawn about what is rendered.
Rig with_print(Rig rig, double sigma_m, Random& random) {
  Marker& marker = rig.instruments[0].marker;
  const double end_m = sigma_m * random.normal();  // a circle
  for (auto* bands_m : {&marker.bands_upper_m, &marker.bands_lower_m}) {
    const double first_m = sigma_m * random.normal(), second_m = sigma_m * random.normal();
    (*bands_m)[0] += first_m, (*bands_m)[1] += second_m - first_m, (*bands_m)[2] += end_m - second_m;
  }
  const double of_two_m = std::sqrt(2.0) * sigma_m;
  marker.sigmas.bands_upper_m = marker.sigmas.bands_lower_m = std::array{sigma_m, of_two_m, of_two_m};
  return rig;
}

TEST(RigSigmas, OfAPrintAreInPsi) {
  constexpr double sigma_m = 0.01e-3;
  const Row row = tracked(testing::paper_test_rig(),
                          [&](const Rig& rig, Random& random) { return with_print(rig, sigma_m, random); });
  row.q.print("print to 0.01 mm", row.told, row.frames);
  EXPECT_GE(row.told, 0.95 * row.frames);
  EXPECT_GT(row.q.of(3), 0.7);
  EXPECT_LT(row.q.of(3), 1.3);
}

// A marker whose diameter is known to 0.5 %, and the places of its edges to so much.
TEST(RigSigmas, OfADiameterAndOfAPrintsEdgesAreInThePose) {
  Rig truth = testing::paper_test_rig();
  truth.instruments[0].marker.gap_rad = 0.1;
  const Row row = tracked(truth, [](Rig rig, Random& random) {
    Marker& marker = rig.instruments[0].marker;
    MarkerSigmas& sigmas = marker.sigmas;
    sigmas.diameter_m = 5e-3 * marker.diameter_m, sigmas.seam_rad = 0.01, sigmas.gap_rad = 0.01;
    sigmas.wrap_m = 0.05e-3;
    marker.diameter_m += *sigmas.diameter_m * random.normal(), marker.seam_rad += *sigmas.seam_rad * random.normal();
    marker.gap_rad += *sigmas.gap_rad * random.normal(), marker.wrap_m += *sigmas.wrap_m * random.normal();
    return rig;
  });
  row.q.print("diameter to 0.5 %, edges to 10 mrad", row.told, row.frames);
  row.pose.print("the marker's pose", row.told, row.frames);
  EXPECT_GE(row.told, 0.95 * row.frames);
  row.q.expect(0.7, 1.3), row.pose.expect(0.7, 1.3);
}

// A camera whose focal lengths, each by itself or both alike, are known to a part, and whose response to so much of its
// values.
struct CameraKnowledge {
  double sigma_focal, sigma_response;
  bool alike = false;
};

Rig with_camera(Rig rig, const CameraKnowledge& known, Random& random) {
  const double sigma_response = known.sigma_response;
  Camera& camera = rig.camera;
  const Eigen::Vector2d sigmas_px = known.sigma_focal * Eigen::Vector2d(camera.fx_px, camera.fy_px);
  const double of_x = random.normal(), of_y = known.alike ? of_x : random.normal();
  camera.sigmas.fx_px = sigmas_px.x(), camera.sigmas.fy_px = sigmas_px.y();
  if (known.alike) {
    camera.covariance.emplace().setZero();
    camera.covariance->topLeftCorner<2, 2>() = sigmas_px * sigmas_px.transpose();
  }
  camera.fx_px += sigmas_px.x() * of_x, camera.fy_px += sigmas_px.y() * of_y;
  if (!(sigma_response > 0)) return rig;
  // v^(1 + x) lies 0.28 x beside v at most, but for another exposure.
  camera.response.gamma *= 1 + sigma_response / 0.28 * random.normal();
  camera.response.sigma = sigma_response;
  return rig;
}

// Without the registration, which such a camera would not have measured.
TEST(RigSigmas, OfACameraAreInThePose) {
  Rig truth = testing::paper_test_rig();
  truth.camera.response = {Response::Kind::power, 2.2};
  for (const CameraKnowledge& known :
       {CameraKnowledge{5e-3, 0}, {5e-3, 0, true}, {0, 0.02}, {5e-3, 0.02}, {5e-3, 0.02, true}}) {
    const Row row = tracked(truth, [&](const Rig& rig, Random& random) {
      Rig drawn = with_camera(rig, known, random);
      drawn.instruments[0].camera_from_rcm.reset();
      return drawn;
    });
    const std::string name = fmt::format("focal length to {:.1f} %{}, response {:.2f}", 100 * known.sigma_focal,
                                         known.alike ? " alike" : "", known.sigma_response);
    row.pose.print(name, row.told, row.frames);
    // Pixels that are not square contradict a print.
    EXPECT_GE(row.told, 0.8 * row.frames) << name;
    row.pose.expect(0.6, 1.4);
  }
}

// A laboratory that calibrates its camera, its handmade marker and its arm, and tracks ten frames more by what that
// wrote.
void track_by_calibrations(std::uint64_t seed, Row& row) {
  SCOPED_TRACE(seed);
  constexpr int frames = 10;
  const laboratories::Recording recording = laboratories::usual_recording(seed);
  Rig rig = laboratories::laboratory(seed), true_rig = rig;
  Marker& marker = true_rig.instruments[0].marker = laboratories::cut_by_hand(rig.instruments[0].marker, seed);
  const CameraCalibration camera = laboratories::calibration_of_camera(recording);
  ASSERT_EQ(camera.refusal, "");
  rig.camera = measured_camera(camera);
  const MarkerCalibration print = laboratories::calibration_of_marker(recording, rig, marker, marker);
  ASSERT_EQ(print.refusal, "");
  rig.instruments[0].marker = print.marker;
  const laboratories::Swing swung = laboratories::swing(recording, true_rig, rig);
  const Instrument& truth = swung.truth.instruments[0];
  const Instrument named = laboratories::names_alone(rig.instruments[0]);
  const Registration found = register_arm(named, swung.poses, swung.joints, "joints");
  ASSERT_EQ(found.refusal, "");
  rig.instruments[0] = registered(named, found);
  Renderer renderer(true_rig.camera, shafts_of(true_rig), make_tissue(rig.camera.width_px, rig.camera.height_px, seed),
                    laboratories::with_noise(recording.noise));
  for (int i = 0; i < frames; ++i) {
    const JointVector q = laboratories::swinging(swung.truth, 20 + 0.7 * i, seed);
    const auto noise = 1000 * seed + 500 + static_cast<std::uint64_t>(i);
    const Observation seen = Tracker(rig).track(renderer.render({placement_of(truth, q)}, noise))[0];
    ++row.frames;
    if (seen.status == Status::ok && seen.rcm) row.add(seen, truth, q);
  }
}

// LAPSERVO_SIGMA_LABORATORIES of them (1). All frames of one share the errors of its calibrations, one draw of each:
// only many have a spread.
TEST(RigSigmas, OfALaboratorysOwnCalibrationsAreInQ) {
  constexpr std::size_t many = 10;
  Row row;
  const auto seeds = seeds_from_environment("LAPSERVO_SIGMA_LABORATORIES", "LAPSERVO_SIGMA_SEED");
  for (const std::uint64_t seed : seeds) track_by_calibrations(seed, row);
  row.q.print("laboratories, q", row.told, row.frames), row.pose.print("laboratories, marker", row.told, row.frames);
  EXPECT_GE(row.told, 0.95 * row.frames);
  EXPECT_LT(row.q.worst(), 4.5);
  EXPECT_LT(row.pose.worst(), 4.5);
  if (seeds.size() < many) return;
  row.q.expect(0.2, 1.4);
  row.pose.expect(0.2, 1.4);
}

}  // namespace lapservo::acceptance::rig_sigmas_test
