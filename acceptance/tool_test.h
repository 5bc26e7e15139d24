#pragma once

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <sys/wait.h>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/has.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::acceptance {

/// The command line's tool in a folder of its own, which is the current one and holds configs/ as a link, empty in/ and
/// out/.
class ToolTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ::setenv("ASAN_OPTIONS", "detect_leaks=0", 1);  // OpenCV's video backends keep what they allocated
    std::filesystem::current_path(folder_.path());
    std::filesystem::create_symlink(testing::source_folder() / "configs", "configs");
    for (const char* folder : {"in", "out"}) std::filesystem::create_directory(folder);
  }
  void TearDown() override { std::filesystem::current_path("/"); }

  /// The exit code; -1 when the tool was killed. `before`: of the shell's line.
  static int run(const std::string& arguments, const std::string& before = "") {
    const std::string command = before + LAPSERVO_TOOL + " " + arguments + " >stdout 2>stderr </dev/null";
    const int status = std::system(command.c_str());
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  static std::string output() { return testing::read_file("stdout"); }
  static std::string errors() { return testing::read_file("stderr"); }

  static void expect_done(const std::string& arguments, const std::string& before = "") {
    EXPECT_EQ(run(arguments, before), 0) << arguments << ": " << errors() << output();
  }
  /// Exit code 1, and all the words in what it says.
  static void expect_failed(const std::string& arguments, const std::vector<std::string>& words) {
    EXPECT_EQ(run(arguments), 1) << arguments << ": " << errors();
    for (const std::string& word : words) expect_in(errors() + output(), word);
  }
  /// Exit code 2, and one line that holds all the words.
  static void expect_refused(const std::string& arguments, const std::vector<std::string>& words,
                             const std::string& before = "") {
    SCOPED_TRACE(before + arguments);
    EXPECT_EQ(run(arguments, before), 2);
    const std::string text = errors();
    EXPECT_TRUE(text.starts_with("lapservo: ")) << text;
    EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
    EXPECT_EQ(text.find("filesystem error"), std::string::npos) << text;
    for (const std::string& word : words) expect_in(text, word);
  }
  static void expect_in(const std::string& text, std::string_view word) { EXPECT_TRUE(testing::has(text, word)); }

 private:
  const testing::TemporaryFolder folder_;
};

}  // namespace lapservo::acceptance
