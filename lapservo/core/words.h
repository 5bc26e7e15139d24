#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

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

/// An enumerator's name, which is the last word in what the compiler calls this function.
template <auto enumerator>
constexpr auto name_of() {
  std::string_view text = __PRETTY_FUNCTION__;  // "auto lapservo::...::name_of() [enumerator = lapservo::Kind::first]"
  text.remove_suffix(1);
  return text.substr(text.rfind(':') + 1);
}

template <typename Enum, int... values>
constexpr Words<Enum, sizeof...(values)> names_of(std::integer_sequence<int, values...> /*all*/) {
  return {{Word<Enum>{static_cast<Enum>(values), name_of<static_cast<Enum>(values)>()}...}};
}

/// The words of an enumeration from 0 to `last` whose words are the names of its enumerators.
template <auto last>
constexpr auto names_up_to = names_of<decltype(last)>(std::make_integer_sequence<int, static_cast<int>(last) + 1>());

}  // namespace lapservo::internal
