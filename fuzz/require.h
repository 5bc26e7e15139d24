#pragma once

#include <cstdio>
#include <cstdlib>
#include <string_view>

#include "lapservo/core/error.h"

namespace lapservo::fuzz {

/// A law for any input. Aborts if it is broken, which libFuzzer reports with the input.
inline void require(bool holds, const char* law) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", law);
  std::abort();
}

/// A complaint is one printable line, however mad the value that it quotes.
inline void require_one_line(const InputError& error) {
  for (const char c : std::string_view(error.what()))
    require(static_cast<unsigned char>(c) >= ' ' && c != 0x7f, "an error's text is one printable line");
}

/// Reads; an InputError of one line is allowed.
template <typename Read>
void read_or_refuse(const Read& read) {
  try {
    read();
  } catch (const InputError& error) {
    require_one_line(error);
  }
}

}  // namespace lapservo::fuzz
