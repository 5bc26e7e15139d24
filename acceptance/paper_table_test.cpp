// docs/paper.md names files, functions and tests, docs/notes/arm.md tests: all of them exist.

#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::paper_table_test {
namespace fs = std::filesystem;

// Without blanks and backticks at their ends.
std::vector<std::string> cells(const std::string& line) {
  std::vector<std::string> found;
  std::istringstream rest(line.substr(1));
  for (std::string cell; std::getline(rest, cell, '|');) {
    const auto first = cell.find_first_not_of(" `"), last = cell.find_last_not_of(" `");
    found.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return found;
}

std::string all_tests(const fs::path& root) {
  std::string text;
  for (const char* folder : {"lapservo", "acceptance", "transports", "web"})
    for (const auto& entry : fs::recursive_directory_iterator(root / folder))
      if (entry.path().string().ends_with("_test.cpp")) text += testing::read_file(entry.path());
  return text;
}

TEST(PaperTable, NamesOnlyWhatThereIs) {
  const fs::path root = testing::source_folder();
  const std::string tests = all_tests(root);
  std::ifstream table(root / "docs/paper.md");
  int rows = 0;
  for (std::string line; std::getline(table, line);) {
    if (!line.starts_with("| ") || line.starts_with("| paper |") || line.starts_with("| ---")) continue;
    SCOPED_TRACE(line);
    const auto row = cells(line);
    ASSERT_EQ(row.size(), 5U);
    EXPECT_NE(testing::read_file(root / row[2]).find(row[3]), std::string::npos) << row[2] << " has no " << row[3];
    std::string test = row[4];
    if (const auto dot = test.find('.'); dot != std::string::npos) test.replace(dot, 1, ", ");
    EXPECT_NE(tests.find(test + (test.empty() ? "" : ")")), std::string::npos) << "no test " << row[4];
    ++rows;
  }
  EXPECT_GT(rows, 25);
}

TEST(ArmTable, NamesOnlyWhatThereIs) {
  const fs::path root = testing::source_folder();
  const std::string tests = all_tests(root), table = testing::read_file(root / "docs/notes/arm.md");
  const std::regex name("`([A-Z]\\w+)\\.([A-Z]\\w+|\\*)`");
  int names = 0;
  for (auto at = std::sregex_iterator(table.begin(), table.end(), name); at != std::sregex_iterator(); ++at, ++names) {
    const std::string test = (*at)[2] == "*" ? "" : (*at)[2].str() + ")";
    EXPECT_NE(tests.find("(" + (*at)[1].str() + ", " + test), std::string::npos) << "no test " << at->str();
  }
  EXPECT_GT(names, 60);
}

}  // namespace lapservo::internal::paper_table_test
