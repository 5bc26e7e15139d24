#pragma once

#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/core/atomic_file.h"
#include "lapservo/report/svg_plot.h"

namespace lapservo::internal {

/// A field of a CSV: a word, a number (the empty field when absent or not finite), a count.
class Field {
 public:
  Field(const char* text) : text_(text) {}
  Field(std::string text) : text_(std::move(text)) {}
  Field(double number);
  Field(std::optional<double> number) : Field(number.value_or(HUGE_VAL)) {}
  Field(int number) : text_(std::to_string(number)) {}
  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

/// A CSV of an experiment: a header line and rows of as many fields. Appears when committed.
class DataFile {
 public:
  /// Throws InputError at once when `path` can't be written.
  DataFile(const std::filesystem::path& path, const std::vector<std::string>& header);
  /// Throws std::logic_error when there are not as many fields as columns.
  void row(const std::vector<Field>& fields);
  void commit() { file_.commit(); }

 private:
  AtomicFile file_;
  std::size_t columns_;
};

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
