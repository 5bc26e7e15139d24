#include "lapservo/core/nearest_word.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

namespace lapservo::internal {
namespace {

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

}  // namespace

const std::string& nearest_word(std::string_view word, const std::vector<std::string>& words) {
  constexpr std::size_t longest = 64;  // the time goes with the product of the lengths
  word = word.substr(0, longest);
  const auto distance = [&](const std::string& other) {
    return std::pair(!other.starts_with(word), edit_distance(word, other));
  };
  return *std::ranges::min_element(words, {}, distance);
}

}  // namespace lapservo::internal
