#include "lapservo/io/tables/configuration_csv.h"

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::configuration_csv_test {

std::vector<Configurations> parse(std::string_view text) {
  Rig rig;
  rig.instruments.resize(2);
  rig.instruments[0].name = "PSM1";
  rig.instruments[1].name = "PSM2";
  return configurations_from(CsvTable::parse(text, "q.csv"), rig, "q.csv");
}

TEST(ConfigurationCsv, NamesDecideWhereARowBelongsOrElseTheRigsOrder) {
  const auto frames = parse("theta_rad,phi_rad,rho_m,psi_rad\n1,2,.3,4\n5,6,.7,8\n-1,-2,-.3,-4\n1,1,.1,1\n");
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0][1].vector(), Eigen::Vector4d(5, 6, 0.7, 8));
  EXPECT_EQ(frames[1][0].vector(), Eigen::Vector4d(-1, -2, -0.3, -4));
  const auto named = parse("instrument,psi_rad,rho_m,phi_rad,theta_rad\nPSM2,4,.3,2,1\nPSM1,8,.7,6,5\n");
  ASSERT_EQ(named.size(), 1U);
  EXPECT_EQ(named[0][0].vector(), Eigen::Vector4d(5, 6, 0.7, 8));
  EXPECT_EQ(named[0][1].vector(), Eigen::Vector4d(1, 2, 0.3, 4));
}

TEST(ConfigurationCsv, RefusesWhatWouldLeaveAnInstrumentNowhere) {
  const auto refusal = [](std::string_view rows) {
    return testing::input_error([&] { parse("instrument,theta_rad,phi_rad,rho_m,psi_rad\n" + std::string(rows)); });
  };
  EXPECT_EQ(refusal("PSM1,1,2,3,4\n"), "q.csv: rows: is 1, expected a row per frame and instrument (2)");
  EXPECT_EQ(refusal("PSM1,1,2,.3,4\nPSM1,1,2,.3,4\n"),
            "q.csv: instrument: is PSM1 twice in frame 0, expected every instrument once a frame");
  EXPECT_EQ(refusal("PSM1,1,2,.3,4\nPSM3,1,2,.3,4\n"), "q.csv: instrument: is PSM3, expected an instrument of the rig");
  EXPECT_EQ(refusal("PSM1,1,2,.3,4\nPSM2,1,,.3,4\n"), "q.csv:3: phi_rad: is empty, expected a finite number");
  EXPECT_EQ(refusal("PSM1,10,80,.1,4\nPSM2,1,2,.3,4\n"),
            "q.csv: theta_rad: is 10, expected radians: it looks like degrees");
  EXPECT_EQ(refusal("PSM1,1,2,120,4\nPSM2,1,2,.3,4\n"),
            "q.csv: rho_m: is 120, expected metres: it looks like millimetres");
}

}  // namespace lapservo::internal::configuration_csv_test
