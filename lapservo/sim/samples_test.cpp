// The renderer beside ray-traced images of the same scenes (another program's work; see ../shared/frames).
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/csv.h"
#include "lapservo/io/image_file.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/test_edge_probe.h"
#include "lapservo/testing/sample_frames.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

struct Pair {
  std::array<Eigen::Vector2d, 4> edges_px;
  Eigen::Vector2d direction;
  cv::Mat sample, rendered;  // linear light
  float gain;
};

// Frames whose brightest channel does not clip, so that boundaries stay where they are.
std::vector<Pair> pairs(const fs::path& folder) {
  const CsvTable truth = CsvTable::read(folder / "truth.csv");
  const Rig rig = load_rig(folder / "rig.yaml");
  const Camera& camera = rig.camera;
  std::vector<Pair> found;
  for (std::size_t row = 0; row < truth.rows(); ++row) {
    const std::string& condition = truth.text(row, "condition");
    const auto mark = condition.find("_I");
    if (mark == std::string::npos) continue;
    const float gain = std::stof(condition.substr(mark + 2)) / 100;
    if (gain > 0.5F) continue;
    Pair pair;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::string e = "e" + std::to_string(k);
      pair.edges_px[k] = {truth.number(row, e + "_u_px"), truth.number(row, e + "_v_px")};
    }
    pair.direction = (pair.edges_px[3] - pair.edges_px[0]).normalized();
    pair.sample = light_of(read_image(folder / truth.text(row, "file")), {});
    RenderOptions options;
    options.sensor.gains = Light::Constant(gain);
    const cv::Mat background(camera.height_px, camera.width_px, CV_32FC3, cv::Scalar::all(0.2));
    Renderer renderer(camera, {shaft_of(rig.instruments[0])}, background, options);
    const JointVector q{truth.number(row, "theta_rad"), truth.number(row, "phi_rad"), truth.number(row, "rho_m"),
                        truth.number(row, "psi_rad")};
    pair.rendered = light_of(renderer.render({placement_of(rig.instruments[0], q)}, row), {});
    pair.gain = gain;
    found.push_back(pair);
  }
  return found;
}

// The middle of each band, at the centre line and 30 px beside it.
TEST(Samples, LightAndNoiseAreAlike) {
  const auto folder = testing::sample_frames("illumination");
  if (!folder) GTEST_SKIP() << "no sample frames";
  const std::vector<Pair> all = pairs(*folder);
  ASSERT_GE(all.size(), 3U);
  double sample_noise = 0, rendered_noise = 0;
  for (const Pair& pair : all) {
    const Eigen::Vector2d across(-pair.direction.y(), pair.direction.x());
    for (std::size_t k = 0; k < 3; ++k)
      for (const double side_px : {-30, 0, 30}) {
        const Eigen::Vector2d at = 0.5 * (pair.edges_px[k] + pair.edges_px[k + 1]) + side_px * across;
        const cv::Rect patch(static_cast<int>(at.x()) - 2, static_cast<int>(at.y()) - 2, 5, 5);
        cv::Scalar a, b, spread_a, spread_b;
        cv::meanStdDev(pair.sample(patch), a, spread_a);
        cv::meanStdDev(pair.rendered(patch), b, spread_b);
        for (int c = 0; c < 3; ++c) {
          EXPECT_NEAR(b[c], a[c], 0.05 * a[c] + 0.012 * pair.gain) << k << ' ' << side_px << ' ' << c;
          sample_noise += spread_a[c] * spread_a[c];
          rendered_noise += spread_b[c] * spread_b[c];
        }
      }
  }
  EXPECT_NEAR(std::sqrt(rendered_noise / sample_noise), 1, 0.15);
}

}  // namespace
}  // namespace lapservo::internal
