#include "lapservo/experiments/data_file.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace lapservo::internal {

Field::Field(double number) : text_(std::isfinite(number) ? fmt::format("{:.9g}", number) : "") {}

DataFile::DataFile(const std::filesystem::path& path, const std::vector<std::string>& header)
    : file_(path), columns_(header.size()) {
  row(std::vector<Field>(header.begin(), header.end()));
}

void DataFile::row(const std::vector<Field>& fields) {
  if (fields.size() != columns_) throw std::logic_error("a row of another length than the header");
  const char* separator = "";
  for (const Field& field : fields) {
    file_.stream() << separator << field.text();
    separator = ",";
  }
  file_.stream() << '\n';
}

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
