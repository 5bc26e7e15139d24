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

class Samples : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto folder = testing::sample_frames("illumination");
    if (!folder) GTEST_SKIP() << "no sample frames";
    pairs_ = pairs(*folder);
    ASSERT_GE(pairs_.size(), 3U);
  }
  std::vector<Pair> pairs_;
};

TEST_F(Samples, BoundariesLieWhereRayTracedOnesDo) {
  double squares = 0, count = 0;
  for (const Pair& pair : pairs_) {
    for (const Eigen::Vector2d& edge : pair.edges_px) {
      const auto in_sample = crossing_px(pair.sample, edge, pair.direction);
      const auto in_rendered = crossing_px(pair.rendered, edge, pair.direction);
      ASSERT_TRUE(in_sample && in_rendered);
      EXPECT_NEAR(*in_rendered, *in_sample, 0.12);
      squares += std::pow(*in_rendered - *in_sample, 2);
      ++count;
    }
  }
  EXPECT_LE(std::sqrt(squares / count), 0.04);
}

// The middle of each band, at the centre line and 30 px beside it.
TEST_F(Samples, LightAndNoiseAreAlike) {
  double sample_noise = 0, rendered_noise = 0;
  for (const Pair& pair : pairs_) {
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

// The rise of light from 20 to 80 % over e1.
TEST_F(Samples, BlurIsAlike) {
  const auto rise_px = [](const cv::Mat& light, const Pair& pair) {
    std::vector<double> at;
    const Eigen::Vector2d across(-pair.direction.y(), pair.direction.x());
    const auto red = [&](double t) {
      double sum = 0;
      for (double side = -3; side <= 3; side += 0.5)
        sum += light_at(light, pair.edges_px[1] + t * pair.direction + side * across)[2];
      return sum;
    };
    const double low = red(4), high = red(-4);
    for (const double level : {0.8, 0.2})
      for (double t = -4; t < 4; t += 0.02)
        if ((red(t) - low) / (high - low) < level) {
          at.push_back(t);
          break;
        }
    return at.at(1) - at.at(0);
  };
  double sample = 0, rendered = 0;
  for (const Pair& pair : pairs_) {
    sample += rise_px(pair.sample, pair);
    rendered += rise_px(pair.rendered, pair);
  }
  EXPECT_NEAR(rendered / sample, 1, 0.1);
}

}  // namespace
}  // namespace lapservo::internal
