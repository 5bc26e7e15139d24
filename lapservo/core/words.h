#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>

namespace lapservo::internal {

/// An enumerator and its word in files and messages.
template <typename Enum>
struct Word {
  Enum value;
  std::string_view text;
};

/// The words of to_string() and ..._from_string() in one table. If a value has several words, the first is written.
template <typename Enum, std::size_t N>
using Words = std::array<Word<Enum>, N>;

/// Empty for what is no enumerator.
template <typename Enum, std::size_t N>
constexpr std::string_view word_of(const Words<Enum, N>& words, Enum value) {
  for (const auto& [known, text] : words)
    if (known == value) return text;
  return {};
}

template <typename Enum, std::size_t N>
constexpr std::optional<Enum> read_word(const Words<Enum, N>& words, std::string_view text) {
  for (const auto& [value, known] : words)
    if (known == text) return value;
  return std::nullopt;
}

/// Whether every enumerator from 0 to `last` has a word, and no word two of them.
template <typename Enum, std::size_t N>
constexpr bool names_all(const Words<Enum, N>& words, Enum last) {
  for (int value = 0; value <= static_cast<int>(last); ++value)
    if (word_of(words, static_cast<Enum>(value)).empty()) return false;
  for (const auto& [value, text] : words)
    if (read_word(words, text) != value) return false;
  return true;
}

}  // namespace lapservo::internal
