#pragma once

#include <string_view>

#include <gtest/gtest.h>

namespace lapservo::testing {

/// Whether a text has a part; a failure shows the text.
inline ::testing::AssertionResult has(std::string_view text, std::string_view part) {
  const bool found = text.find(part) != std::string_view::npos;
  return ::testing::AssertionResult(found) << "'" << part << "' is " << (found ? "" : "not ") << "in: " << text;
}

}  // namespace lapservo::testing
