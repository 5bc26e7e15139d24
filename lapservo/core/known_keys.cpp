#include "lapservo/core/known_keys.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "lapservo/core/nearest_word.h"

namespace lapservo::internal {
namespace {

constexpr std::string_view sigma_prefix = "sigma_";

std::vector<std::string> all_names(const KnownKeys& known) {
  std::vector<std::string> names(known.words.begin(), known.words.end());
  names.insert(names.end(), known.measured.begin(), known.measured.end());
  for (const std::string_view key : known.measured) names.push_back(std::string(sigma_prefix).append(key));
  return names;
}

// An alias may name what it is part of.
void expect_sigma(const YamlField& field, int levels = 3) {
  if (levels == 0) field.fail("nested", sigmas_expected);
  if (field.is_scalar()) {
    field.number_between(0, std::numeric_limits<double>::max(), sigmas_expected);
  } else if (field.is_map()) {
    for (const auto& [key, value] : field.entries(sigmas_expected)) expect_sigma(value, levels - 1);
  } else {
    for (const YamlField& item : field.list(sigmas_expected)) expect_sigma(item, levels - 1);
  }
}

bool is_sigma_of(const std::string& key, const KnownKeys& known) {
  return key.starts_with(sigma_prefix) && std::find(known.measured.begin(), known.measured.end(),
                                                    key.substr(sigma_prefix.size())) != known.measured.end();
}

// Names the first unknown key with the nearest known one, and the next few.
void refuse_unknown(const std::vector<std::pair<std::string, YamlField>>& entries,
                    const std::vector<std::string>& names) {
  const auto is_unknown = [&](const auto& entry) {
    return std::find(names.begin(), names.end(), entry.first) == names.end();
  };
  const auto first = std::find_if(entries.begin(), entries.end(), is_unknown);
  if (first == entries.end()) return;
  constexpr int most_others = 8;
  std::string others;
  int count = 0;
  for (auto entry = std::next(first); entry != entries.end() && count < most_others; ++entry)
    if (is_unknown(*entry)) others += (count++ == 0 ? "; unknown too: " : ", ") + entry->first;
  first->second.fail("unknown",
                     "a known key, of which " + nearest_word(first->first, names) + " is the nearest" + others);
}

}  // namespace

void expect_keys(const YamlField& map, const KnownKeys& known) {
  if (!map.is_map()) return;
  const std::vector<std::string> names = all_names(known);
  const auto entries = map.entries("a map");
  refuse_unknown(entries, names);
  std::vector<std::string> seen;
  for (const auto& [key, value] : entries) {
    if (std::find(seen.begin(), seen.end(), key) != seen.end()) value.fail("there twice", "every key once");
    if (!value.present()) value.fail("empty", "a value, or no such key");
    if (is_sigma_of(key, known)) {
      if (!map[key.substr(sigma_prefix.size())].present())
        value.fail("alone", key.substr(sigma_prefix.size()) + " beside it");
      expect_sigma(value);
    }
    seen.push_back(key);
  }
}

}  // namespace lapservo::internal
