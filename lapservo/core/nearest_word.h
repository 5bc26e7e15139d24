#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace lapservo::internal {

/// The word of a non-empty list that begins with the given one, else all of them: the one with the fewest insertions,
/// deletions and changes of a letter (Levenshtein distance).
const std::string& nearest_word(std::string_view word, const std::vector<std::string>& words);

}  // namespace lapservo::internal
