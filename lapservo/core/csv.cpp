#include "lapservo/core/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>
#include <utility>

#include "lapservo/core/error.h"
#include "lapservo/core/input_file.h"

namespace lapservo::internal {
namespace {

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

// Takes a field in double quotes, "" within standing for one, off the front; nullopt when it isn't closed or more than
// blanks follow before the comma.
std::optional<std::string> take_quoted(std::string_view& line) {
  std::string field;
  for (std::size_t i = 1; i < line.size(); ++i) {
    if (line[i] != '"') {
      field += line[i];
    } else if (line.substr(i).starts_with(R"("")")) {
      field += line[i++];
    } else {
      line.remove_prefix(i + 1);
      if (!trimmed(line.substr(0, line.find(','))).empty()) return std::nullopt;
      return field;
    }
  }
  return std::nullopt;
}

std::optional<std::vector<std::string>> split_fields(std::string_view line) {
  std::vector<std::string> fields;
  while (true) {
    line.remove_prefix(std::min(line.find_first_not_of(" \t\r"), line.size()));
    if (line.starts_with('"')) {
      auto field = take_quoted(line);
      if (!field) return std::nullopt;
      fields.push_back(std::move(*field));
    } else {
      fields.emplace_back(trimmed(line.substr(0, line.find(','))));
    }
    const auto comma = line.find(',');
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

// Where the row ends that begins the text: at the first line end outside of quotes, or of all where a quote isn't
// closed.
std::size_t row_end(std::string_view text) {
  std::size_t at = 0;
  while (true) {
    at = std::min(text.find_first_not_of(" \t\r", at), text.size());
    if (at < text.size() && text[at] == '"') {
      const std::size_t open = at++;
      while (at < text.size() && (text[at] != '"' || text.substr(at).starts_with(R"("")")))
        at += text[at] == '"' ? 2 : 1;
      if (at >= text.size()) return text.find('\n', open);
    }
    at = text.find_first_of(",\n", at);
    if (at == std::string_view::npos || text[at] == '\n') return at;
    ++at;
  }
}

std::string names(const std::vector<std::string>& header) {
  std::string text;
  for (const std::string& name : header) text += (text.empty() ? "" : ",") + name;
  constexpr std::size_t longest = 80;
  return text.size() <= longest ? text : text.substr(0, longest) + "...";
}

std::string at_line(const std::string& source, std::size_t line) {
  return source + ":" + std::to_string(line);
}

}  // namespace

std::optional<double> parse_finite(std::string_view text) {
  double value = 0;
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);  // which from_chars refuses
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::string csv_field(std::string_view text) {
  if (text.find('\0') != std::string_view::npos) throw InputError("CSV", "field", text, "text without NUL bytes");
  if (trimmed(text).size() == text.size() && text.find_first_of(",\"\n\r") == std::string_view::npos)
    return std::string(text);
  std::string field = "\"";
  for (const char c : text) field.append(c == '"' ? 2 : 1, c);
  return field += '"';
}

CsvTable CsvTable::read(const std::filesystem::path& path) {
  constexpr std::size_t max_bytes = std::size_t{256} << 20;
  return parse(read_input(path, max_bytes, "a CSV file"), path.string());
}

CsvTable CsvTable::parse(std::string_view text, std::string source) {
  if (text.find('\0') != std::string_view::npos) throw InputError(source, "holds NUL bytes, expected CSV text");
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";  // spreadsheets write it
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  CsvTable table;
  table.source_ = std::move(source);
  std::size_t next_number = 1;
  while (!text.empty()) {
    const auto end = row_end(text);
    const std::string_view line = text.substr(0, end);
    const std::size_t line_number = next_number;
    next_number += 1 + static_cast<std::size_t>(std::count(line.begin(), line.end(), '\n'));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (trimmed(line).empty()) continue;
    auto split = split_fields(line);
    if (!split) throw InputError(at_line(table.source_, line_number), "has a quote that does not end with its field");
    std::vector<std::string> fields = std::move(*split);
    if (table.header_.empty()) {
      if (fields.size() == 1 && fields[0].find_first_of(";\t") != std::string::npos)
        throw InputError(at_line(table.source_, line_number),
                         "separates columns by semicolons or tabs, expected commas, and decimal points in numbers");
      table.header_ = std::move(fields);
      continue;
    }
    if (fields.size() != table.header_.size())
      throw InputError(at_line(table.source_, line_number),
                       "has " + std::to_string(fields.size()) + " fields, expected " +
                           std::to_string(table.header_.size()) + " as the header has" +
                           (table.header_[0].starts_with('#') ? ", which is a comment: remove it" : ""));
    table.rows_.push_back(std::move(fields));
    table.line_numbers_.push_back(line_number);
  }
  if (table.header_.empty()) throw InputError(table.source_, "is empty, expected a CSV file with a header line");
  return table;
}

bool CsvTable::has(std::string_view column) const {
  return std::find(header_.begin(), header_.end(), column) != header_.end();
}

std::size_t CsvTable::index_of(std::string_view column) const {
  const auto found = std::find(header_.begin(), header_.end(), column);
  if (found == header_.end())
    throw InputError(source_, "has no column '" + std::string(column) + "', expected one beside " + names(header_));
  if (std::find(found + 1, header_.end(), column) != header_.end())
    throw InputError(source_, "has several columns '" + std::string(column) + "', expected one");
  return static_cast<std::size_t>(found - header_.begin());
}

const std::string& CsvTable::text(std::size_t row, std::string_view column) const {
  return rows_.at(row)[index_of(column)];
}

std::optional<double> CsvTable::number_or_empty(std::size_t row, std::string_view column) const {
  const std::string& field = text(row, column);
  if (field.empty()) return std::nullopt;
  const auto value = parse_finite(field);
  if (!value) throw InputError(at_line(source_, line_numbers_[row]), column, field, "a finite number");
  return value;
}

double CsvTable::number(std::size_t row, std::string_view column) const {
  const auto value = number_or_empty(row, column);
  if (!value) throw InputError(at_line(source_, line_numbers_.at(row)), column, "", "a finite number");
  return *value;
}

}  // namespace lapservo::internal
