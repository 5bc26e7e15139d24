#pragma once

#include <string>
#include <string_view>

#include <gtest/gtest.h>

namespace lapservo::testing {

/// Whether a text has a part; a failure shows the text.
inline ::testing::AssertionResult has(std::string_view text, std::string_view part) {
  const bool found = text.find(part) != std::string_view::npos;
  return ::testing::AssertionResult(found) << "'" << part << "' is " << (found ? "" : "not ") << "in: " << text;
}

/// The text with the first such part, which it has, replaced.
inline std::string replaced(std::string text, std::string_view part, std::string_view by) {
  const std::size_t at = text.find(part);
  EXPECT_NE(at, std::string::npos) << part;
  return at == std::string::npos ? text : text.replace(at, part.size(), by);
}

}  // namespace lapservo::testing
