#include "lapservo/experiments/data_file.h"

#include <filesystem>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::data_file_test {
namespace fs = std::filesystem;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(DataFile, ComesBack) {
  const testing::TemporaryFolder folder;
  DataFile file(folder / "a.csv", {"word", "number", "maybe"});
  file.row({"one", -1.25e-7, std::optional<double>()});
  file.row({std::string("two"), nan, 3});
  EXPECT_FALSE(fs::exists(folder / "a.csv")) << "not before it is whole";
  file.commit();
  const CsvTable table = CsvTable::read(folder / "a.csv");
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_EQ(table.text(0, "word"), "one");
  EXPECT_EQ(table.number(0, "number"), -1.25e-7);
  EXPECT_FALSE(table.number_or_empty(0, "maybe"));
  EXPECT_FALSE(table.number_or_empty(1, "number")) << "nothing that is not finite";
  EXPECT_EQ(table.number(1, "maybe"), 3);
}

TEST(DataFile, ARowHasAsManyFieldsAsTheHeader) {
  const testing::TemporaryFolder folder;
  DataFile file(folder / "b.csv", {"one", "two"});
  EXPECT_THROW(file.row({1}), std::logic_error);
  EXPECT_THROW(file.row({1, 2, 3}), std::logic_error);
  EXPECT_THROW(DataFile(folder / "missing/b.csv", {"one"}), InputError);
}

TEST(DataFile, ARunComesBackAndIsPlotted) {
  const testing::TemporaryFolder folder;
  const TimeTable run{{0, 0.5, 1}, {{"s_rad", {0.1, nan, 0.3}}, {"l_px", {300, 301, 302}}}};
  write_data(run, folder / "run.csv");
  const CsvTable table = CsvTable::read(folder / "run.csv");
  EXPECT_EQ(table.number(1, "time_s"), 0.5);
  EXPECT_EQ(table.number(2, "l_px"), 302);
  EXPECT_FALSE(table.number_or_empty(1, "s_rad"));
  const Series series = over_time(run, "s_rad", "measured", 0, Draw::line, 1000);
  EXPECT_EQ(series.y[2], 300);
  EXPECT_EQ(series.x, run.time_s);
  EXPECT_THROW(over_time(run, "d_px", "", 0), std::out_of_range);
  EXPECT_NE(svg_from(time_plot("s", "error", "mrad", {series})).find("time [s]"), std::string::npos);
  EXPECT_THROW(write_data({{0, 1}, {{"short", {1}}}}, folder / "short.csv"), std::logic_error);
}

}  // namespace lapservo::internal::data_file_test
