// `lapservo estimate-rcm` as its user meets it, and the accuracy promised for it.

#include <cmath>
#include <filesystem>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "acceptance/tool_test.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/random.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal::estimate_rcm_test {
using lapservo::testing::read_file;
using lapservo::testing::write_file;

class EstimateRcm : public acceptance::ToolTest {
 protected:
  static std::string write(const std::string& name, const std::string& content) {
    write_file(name, content);
    return name;
  }
};

const std::string header = "frame,instrument,status,e0_u_px,e0_v_px,e3_u_px,e3_v_px\n";

// Rows as `lapservo track` would write them, of lines through a point of the ideal image, seen through a lens.
std::string observed_lines(const Camera& camera, const std::string& instrument, const Eigen::Vector2d& rcm_px,
                           double noise_px, Random& random) {
  std::ostringstream rows;
  rows.precision(12);
  for (int frame = 0; frame < 20; ++frame) {
    const Eigen::Vector2d middle(random.uniform(200, 1080), random.uniform(100, 620));
    const Eigen::Vector2d along = (middle - rcm_px).normalized();
    const auto seen = [&](double at_px) {
      const Eigen::Vector2d raw = camera.raw_from_ideal(middle + at_px * along);
      return Eigen::Vector2d(raw + noise_px * Eigen::Vector2d(random.normal(), random.normal()));
    };
    const Eigen::Vector2d e0 = seen(-150), e3 = seen(150);
    rows << frame << ',' << instrument << ",ok," << e0.x() << ',' << e0.y() << ',' << e3.x() << ',' << e3.y() << '\n';
  }
  return rows.str();
}

// Section V-B with 20 positions: the paper has 3.62 +- 2.13 px. The rig that tracks knows no RCM.
TEST_F(EstimateRcm, WithinAPixelFromTwentyPositions) {
  std::string free_rig = read_file("configs/paper.yaml");
  free_rig.resize(free_rig.find("    camera_from_rcm"));
  write("free.yaml", free_rig);
  expect_done("render --rig configs/paper.yaml --out frames --count 20 --seed 3");
  expect_done("track frames --rig free.yaml --single --out obs.csv");
  expect_done("estimate-rcm obs.csv --rig configs/paper.yaml --out rcm.csv");
  EXPECT_EQ(errors(), "");
  const CsvTable report = CsvTable::read("rcm.csv"), truth = CsvTable::read("frames/truth.csv");
  ASSERT_EQ(report.rows(), 2U);
  EXPECT_EQ(report.text(0, "method"), "weighted");
  EXPECT_EQ(report.text(1, "method"), "pairwise");
  EXPECT_LT(report.number(0, "distance_px"), 1);
  EXPECT_LT(report.number(0, "sigma_u_px"), 1);
  EXPECT_LT(report.number(0, "distance_px"),
            4 * std::hypot(report.number(0, "sigma_u_px"), report.number(0, "sigma_v_px")));
  EXPECT_NEAR(report.number(0, "rcm_u_px"), truth.number(0, "rcm_u_px"), 1);
  EXPECT_NEAR(report.number(0, "rcm_v_px"), truth.number(0, "rcm_v_px"), 1);
}

TEST_F(EstimateRcm, UndistortsWithARigAndWarnsWithout) {
  constexpr std::uint64_t seed = 81;
  Random random(seed);
  const std::string bent =
      write("bent.yaml", lapservo::testing::replaced(read_file("configs/paper.yaml"), "data: [0, 0, 0, 0, 0]",
                                                     "data: [-0.25, 0.08, 0.001, -0.0005, 0]"));
  const Rig rig = load_rig(bent);
  const Eigen::Vector3d t = rig.instruments.front().camera_from_rcm->translation;
  const std::string observations =
      write("obs.csv", header + observed_lines(rig.camera, "PSM1", rig.camera.ideal_from_point(t), 1e-2, random));
  expect_done("estimate-rcm " + observations + " --rig " + bent + " --out rcm.csv");
  EXPECT_LT(CsvTable::read("rcm.csv").number(0, "distance_px"), 0.3);
  EXPECT_EQ(errors(), "");
  expect_done("estimate-rcm " + observations + " --out rcm.csv");
  expect_in(errors(), "without --rig");
  EXPECT_GT(CsvTable::read("rcm.csv").number(0, "noise_px"), 0.1);
}

TEST_F(EstimateRcm, GivesEveryInstrumentItsOwn) {
  constexpr std::uint64_t seed = 82;
  Random random(seed);
  const Camera camera = load_rig("configs/paper.yaml").camera;
  const std::string observations =
      write("obs.csv", header + observed_lines(camera, "left", {-300, 900}, 0.02, random) +
                           observed_lines(camera, "\"right, second\"", {1600, 800}, 0.02, random) +
                           "20,lost,no_marker,,,,\n");
  expect_done("estimate-rcm " + observations + " --sigma-px 0.02 --out rcm.csv");
  const CsvTable report = CsvTable::read("rcm.csv");
  ASSERT_EQ(report.rows(), 6U);
  EXPECT_NEAR(report.number(0, "rcm_u_px"), -300, 2);
  EXPECT_EQ(report.text(2, "instrument"), "lost");
  EXPECT_EQ(report.text(2, "status"), "too_few_lines");
  EXPECT_EQ(report.text(2, "rcm_u_px"), "");
  EXPECT_EQ(report.text(4, "instrument"), "right, second");
  EXPECT_NEAR(report.number(4, "rcm_v_px"), 800, 2);
  EXPECT_NEAR(report.number(4, "chi2"), 18, 18);
  expect_done("estimate-rcm " + observations + " --sigma-px 0.02 --common-px 1 --out wide.csv");
  EXPECT_GT(CsvTable::read("wide.csv").number(4, "sigma_u_px"), 5 * report.number(4, "sigma_u_px"));
  expect_refused("estimate-rcm " + observations + " --rig configs/paper.yaml --out none.csv",
                 {"obs.csv", "left", "paper.yaml"});
  EXPECT_FALSE(std::filesystem::exists("none.csv"));
}

TEST_F(EstimateRcm, ExitsWithOneWhenThereIsNone) {
  const std::string one = "0,PSM1,ok,100,100,300,100\n", beside = "1,PSM1,ok,100,200,300,200\n";
  EXPECT_EQ(run("estimate-rcm " + write("none.csv", header)), 1);
  EXPECT_EQ(run("estimate-rcm " + write("one.csv", header + one + "1,PSM1,cut,,,,\n")), 1);
  expect_in(output(), "too_few_lines");
  EXPECT_EQ(run("estimate-rcm " + write("parallel.csv", header + one + beside)), 1);
  expect_in(output(), "parallel");
}

}  // namespace lapservo::internal::estimate_rcm_test
