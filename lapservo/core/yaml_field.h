#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lapservo/core/error.h"

namespace YAML {
class Node;
}

namespace lapservo::internal {

/// The text of a YAML file. Throws InputError when it can't be opened, is empty or larger than 1 MiB.
std::string read_yaml(const std::filesystem::path& path);

/// A value in a YAML file, or the place where one is missing. It knows where it stands, so every complaint is an
/// InputError that names file, field, value and what was expected.
class YamlField {
 public:
  /// `kind` says what the file should be, for example "rig file". Throws InputError when it can't be opened, is empty,
  /// larger than 1 MiB, nests more deeply than any file of ours, is not YAML or holds a second document.
  static YamlField read(const std::filesystem::path& path, std::string_view kind);
  /// The same from text; `source` stands for the file's name in complaints.
  static YamlField parse(std::string_view yaml, const std::string& source, std::string_view kind);

  [[noreturn]] void fail(std::string_view value, std::string_view expected) const;
  /// The same of one of its own fields.
  [[noreturn]] void fail_within(const FieldProblem& problem) const;
  /// The value as complaints show it.
  std::string value_text() const;
  /// The value as YAML under this key of a map: whole lines.
  std::string yaml_of(const std::string& key) const;

  bool present() const;
  bool is_scalar() const;
  bool is_map() const;

  /// The value of a map's key, present or not.
  YamlField operator[](const std::string& key) const;
  /// Keys and values of a map, in the file's order.
  std::vector<std::pair<std::string, YamlField>> entries(std::string_view expected) const;
  std::vector<YamlField> list(std::string_view expected) const;
  /// Not empty.
  std::string text(std::string_view expected) const;
  /// `true` or `false`.
  bool boolean() const;
  /// Finite.
  double number(std::string_view expected) const;
  double number_between(double low, double high, std::string_view expected) const;
  /// A list of N numbers, each within +-`largest`.
  template <std::size_t N>
  std::array<double, N> numbers(std::string_view expected, double largest = std::numeric_limits<double>::infinity(),
                                std::string_view item_expected = "a finite number") const {
    const auto items = list(expected);
    if (items.size() != N) fail(value_text(), expected);
    std::array<double, N> values{};
    for (std::size_t i = 0; i < N; ++i) values[i] = items[i].number_between(-largest, largest, item_expected);
    return values;
  }

 private:
  YamlField(std::string source, std::string path, const YAML::Node& node);
  YamlField at_key(const std::string& key, const YAML::Node& node) const;

  std::string source_, path_;
  std::shared_ptr<const YAML::Node> node_;  // behind a pointer, so that who includes this needs no yaml-cpp
};

}  // namespace lapservo::internal
