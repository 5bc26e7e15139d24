#include "lapservo/experiments/data_file.h"

#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

namespace lapservo::internal {

Field::Field(double number) : text_(std::isfinite(number) ? fmt::format("{:.9g}", number) : "") {}

DataFile::DataFile(const std::filesystem::path& path, const std::vector<std::string>& header)
    : file_(path), columns_(header.size()) {
  const char* separator = "";
  for (const std::string& name : header) {
    file_.stream() << separator << name;
    separator = ",";
  }
  file_.stream() << '\n';
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

}  // namespace lapservo::internal
