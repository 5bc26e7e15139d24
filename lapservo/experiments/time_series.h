#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "lapservo/report/svg_plot.h"

namespace lapservo::internal {

/// A run: what was recorded at each instant.
struct TimeTable {
  struct Column {
    std::string name;            ///< with its unit, as in a CSV's header: s_rad
    std::vector<double> values;  ///< one an instant; not finite where there was none
  };
  std::vector<double> time_s;
  std::vector<Column> columns;

  /// Throws std::out_of_range when there is no such column.
  const Column& column(const std::string& name) const;
};

/// time_s and the columns. Throws InputError when it can't be written, std::logic_error when a column is longer or
/// shorter than time_s.
void write_data(const TimeTable& table, const std::filesystem::path& path);

/// A column as a line of a plot over time, its values multiplied by `scale`.
Series over_time(const TimeTable& table, const std::string& column, std::string legend, int colour,
                 Draw draw = Draw::line, double scale = 1);

}  // namespace lapservo::internal
