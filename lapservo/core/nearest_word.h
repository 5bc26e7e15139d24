#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace lapservo::internal {

/// Of at least one word the one with the fewest insertions, deletions and changes of a letter between (Levenshtein).
const std::string& nearest_word(std::string_view word, const std::vector<std::string>& words);

}  // namespace lapservo::internal
