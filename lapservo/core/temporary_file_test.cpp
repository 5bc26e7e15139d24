#include "lapservo/core/temporary_file.h"

#include <filesystem>
#include <string>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;
using testing::TemporaryFolder;

// Ends in a process of its own, as if killed.
void leave_killed(const OutputTarget& target) {
  const pid_t child = ::fork();
  if (child == 0) {
    const TemporaryFile file(target, TemporaryFile::Name::always);
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
}

TEST(TemporaryFile, WithANameKeepsTheExtensionAndIsGoneInTheEnd) {
  const TemporaryFolder folder;
  const OutputTarget target = output_target(folder / "a.mp4");
  {
    const TemporaryFile file(target, TemporaryFile::Name::always);
    EXPECT_EQ(file.path().extension(), ".mp4");
    EXPECT_EQ(file.path().parent_path(), folder.path());
    EXPECT_TRUE(fs::exists(file.path()));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(TemporaryFile, TheNextOneRemovesWhatAKilledWriterLeftAndNothingElse) {
  const TemporaryFolder folder;
  const OutputTarget target = output_target(folder / "a.mp4");
  leave_killed(target);
  ASSERT_FALSE(fs::is_empty(folder.path()));
  const fs::path left = fs::directory_iterator(folder.path())->path();
  const TemporaryFile running(target, TemporaryFile::Name::always);
  EXPECT_FALSE(fs::exists(left));
  testing::write_file(folder / ".lapservo-notes", "mine");
  fs::create_directory(folder / ".lapservo-99999999-0");
  { const TemporaryFile next(target, TemporaryFile::Name::always); }
  EXPECT_TRUE(fs::exists(running.path())) << "its writer is at work";
  EXPECT_TRUE(fs::exists(folder / ".lapservo-notes"));
  EXPECT_TRUE(fs::exists(folder / ".lapservo-99999999-0"));
}

TEST(TemporaryFile, WithoutANameIsNotSeen) {
  const TemporaryFolder folder;
  const OutputTarget target = output_target(folder / "a.csv");
  TemporaryFile file(target);
  if (!file.path().empty()) GTEST_SKIP() << "this file system has no files without a name";
  EXPECT_TRUE(fs::is_empty(folder.path()));
  write_all(file.descriptor(), "text");
  file.commit();
  EXPECT_EQ(testing::read_file(folder / "a.csv"), "text");
}

}  // namespace
}  // namespace lapservo::internal
