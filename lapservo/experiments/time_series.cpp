#include "lapservo/experiments/time_series.h"

#include <stdexcept>

#include "lapservo/experiments/data_file.h"

namespace lapservo::internal {

const TimeTable::Column& TimeTable::column(const std::string& name) const {
  for (const Column& candidate : columns)
    if (candidate.name == name) return candidate;
  throw std::out_of_range("no column " + name);
}

void write_data(const TimeTable& table, const std::filesystem::path& path) {
  std::vector<std::string> header{"time_s"};
  for (const auto& column : table.columns) {
    if (column.values.size() != table.time_s.size())
      throw std::logic_error("column " + column.name + " has another length than time_s");
    header.push_back(column.name);
  }
  DataFile file(path, header);
  for (std::size_t i = 0; i < table.time_s.size(); ++i) {
    std::vector<Field> row{table.time_s[i]};
    for (const auto& column : table.columns) row.emplace_back(column.values[i]);
    file.row(row);
  }
  file.commit();
}

Series over_time(const TimeTable& table, const std::string& column, std::string legend, int colour, Draw draw,
                 double scale) {
  Series series{std::move(legend), table.time_s, table.column(column).values, draw, colour};
  for (double& value : series.y) value *= scale;
  return series;
}

}  // namespace lapservo::internal
