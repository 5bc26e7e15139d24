#pragma once

#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/core/atomic_file.h"

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

}  // namespace lapservo::internal
