#include "lapservo/core/known_keys.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

namespace lapservo::internal {
namespace {

constexpr std::string_view sigma_prefix = "sigma_";

// Insertions, deletions and changes of one letter that lead from one word to the other (Levenshtein).
std::size_t edit_distance(std::string_view from, std::string_view to) {
  std::vector<std::size_t> row(to.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < from.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t k = 0; k < to.size(); ++k) {
      const std::size_t changed = diagonal + (from[i] == to[k] ? 0 : 1);
      diagonal = row[k + 1];
      row[k + 1] = std::min({changed, row[k] + 1, diagonal + 1});
    }
  }
  return row.back();
}

std::vector<std::string> all_names(const KnownKeys& known) {
  std::vector<std::string> names(known.words.begin(), known.words.end());
  names.insert(names.end(), known.measured.begin(), known.measured.end());
  for (const std::string_view key : known.measured) names.push_back(std::string(sigma_prefix).append(key));
  return names;
}

const std::string& nearest(std::string_view key, const std::vector<std::string>& names) {
  constexpr std::size_t longest = 64;  // no key of ours is longer, and the time goes with the product of the lengths
  key = key.substr(0, longest);
  return *std::min_element(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return edit_distance(key, a) < edit_distance(key, b);
  });
}

void expect_sigma(const YamlField& field) {
  if (field.is_scalar()) {
    field.number_between(0, std::numeric_limits<double>::max(), sigmas_expected);
  } else if (field.is_map()) {
    for (const auto& [key, value] : field.entries(sigmas_expected)) expect_sigma(value);
  } else {
    for (const YamlField& item : field.list(sigmas_expected)) expect_sigma(item);
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
  first->second.fail("unknown", "a known key, of which " + nearest(first->first, names) + " is the nearest" + others);
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
