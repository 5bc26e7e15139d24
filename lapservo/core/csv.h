#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace lapservo::internal {

/// A comma-separated table with one header line, as all our files have; a row is a line, fields may stand in double
/// quotes and then hold line ends. CRLF and a byte order mark are tolerated. Every row has as many fields as the
/// header. Errors name the file, the line and the column.
class CsvTable {
 public:
  /// Throws InputError when the file can't be read, is empty, holds NUL bytes or a row of another length.
  static CsvTable read(const std::filesystem::path& path);
  static CsvTable parse(std::string_view text, std::string source);

  std::size_t rows() const { return rows_.size(); }
  const std::vector<std::string>& columns() const { return header_; }
  bool has(std::string_view column) const;
  /// Throws InputError when there is no such column, or more than one.
  const std::string& text(std::size_t row, std::string_view column) const;
  /// Empty field: nullopt. Anything but a finite number: InputError.
  std::optional<double> number_or_empty(std::size_t row, std::string_view column) const;
  /// As above; an empty field is an error too.
  double number(std::size_t row, std::string_view column) const;

 private:
  std::size_t index_of(std::string_view column) const;

  std::string source_;
  std::vector<std::string> header_;
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> line_numbers_;
};

/// A text as a field of such a table: quoted where a comma, a quote, a line end or blanks at its ends need it. Throws
/// InputError when it holds NUL bytes.
std::string csv_field(std::string_view text);

/// The whole text as one finite number, or nullopt.
std::optional<double> parse_finite(std::string_view text);

}  // namespace lapservo::internal
