#include "lapservo/core/row_file.h"

#include <csignal>
#include <filesystem>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;
using testing::input_error;
using testing::read_file;
using testing::TemporaryFolder;

// Two rows by a process that is killed then.
void leave_killed(const fs::path& path, const char* header) {
  const pid_t child = ::fork();
  if (child == 0) {
    RowFile file(path, header);
    file.add("1,2");
    file.add("3,4");
    ::raise(SIGKILL);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));
}

TEST(RowFile, RowsAreInTheFileAtOnceAndUnderItsNameInTheEnd) {
  const TemporaryFolder folder;
  testing::write_file(folder / "o.csv", "old");
  RowFile file(folder / "o.csv", "a,b");
  file.add("1,2");
  EXPECT_EQ(read_file(folder / "o.csv.part"), "a,b\n1,2\n");
  EXPECT_EQ(read_file(folder / "o.csv"), "old");
  file.commit();
  EXPECT_EQ(read_file(folder / "o.csv"), "a,b\n1,2\n");
  EXPECT_FALSE(fs::exists(folder / "o.csv.part"));
}

TEST(RowFile, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  { RowFile(folder / "o.csv", "a,b").add("1,2"); }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(RowFile, WhatAKilledRunLeftStaysUntilTheNextHasARow) {
  const TemporaryFolder folder;
  leave_killed(folder / "o.csv", "a,b");
  const std::string left = "a,b\n1,2\n3,4\n";
  EXPECT_EQ(read_file(folder / "o.csv.part"), left);
  { RowFile(folder / "o.csv", "a,b"); }
  EXPECT_EQ(read_file(folder / "o.csv.part"), left) << "a run that fails at once loses nothing";
  RowFile next(folder / "o.csv", "a,b");
  next.add("5,6");
  EXPECT_EQ(read_file(folder / "o.csv.part"), "a,b\n5,6\n");
  next.commit();
  EXPECT_EQ(read_file(folder / "o.csv"), "a,b\n5,6\n");
}

TEST(RowFile, LeavesAloneWhatIsNotItsOwnUnfinishedTable) {
  const TemporaryFolder folder;
  const std::string path = (folder / "o.csv").string(),
                    refusal = path + ": can't be written: " + path +
                              ".part is in the way, and is no unfinished file of this kind";
  const auto said = [&] { return input_error([&] { RowFile(path, "a,b"); }); };
  testing::write_file(path + ".part", "my notes, quite long");
  EXPECT_EQ(said(), refusal);
  EXPECT_EQ(read_file(path + ".part"), "my notes, quite long");
  fs::remove(path + ".part");
  testing::write_file(folder / "elsewhere", "a,b\n");
  fs::create_symlink("elsewhere", path + ".part");
  EXPECT_EQ(said(), refusal);
  fs::remove(path + ".part");
  fs::create_directory(path + ".part");
  EXPECT_EQ(said(), refusal);
}

TEST(RowFile, TwoRunsDoNotShareAFile) {
  const TemporaryFolder folder;
  RowFile first(folder / "o.csv", "a,b");
  first.add("1,2");
  EXPECT_EQ(input_error([&] { RowFile(folder / "o.csv", "a,b"); }),
            (folder / "o.csv").string() + ": is being written by another run");
  first.commit();
  EXPECT_EQ(read_file(folder / "o.csv"), "a,b\n1,2\n");
}

TEST(RowFile, AFullDiskKeepsTheWholeRowsBefore) {
  const TemporaryFolder folder;
  const auto previous = std::signal(SIGXFSZ, SIG_IGN);
  struct rlimit old {};
  ::getrlimit(RLIMIT_FSIZE, &old);
  const struct rlimit small { 10, old.rlim_max };
  RowFile file(folder / "o.csv", "a,b");
  file.add("1,2");
  ::setrlimit(RLIMIT_FSIZE, &small);
  const std::string said = input_error([&] { file.add("3,4,5,6,7,8"); });
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, previous);
  const std::string path = (folder / "o.csv").string();
  EXPECT_EQ(said, path + ": could not be written to its end: File too large; the rows before are in " + path + ".part");
  EXPECT_EQ(read_file(path + ".part"), "a,b\n1,2\n");
}

TEST(RowFile, WritesThroughALinkWhichStays) {
  const TemporaryFolder folder;
  testing::write_file(folder / "real.csv", "old");
  fs::create_symlink("real.csv", folder / "link.csv");
  RowFile file(folder / "link.csv", "a,b");
  file.commit();
  EXPECT_TRUE(fs::is_symlink(folder / "link.csv"));
  EXPECT_EQ(read_file(folder / "real.csv"), "a,b\n");
}

TEST(RowFile, AStreamThatTakesNothingIsAnErrorAtOnce) {
  EXPECT_EQ(input_error([] { RowFile("/dev/full", "a,b"); }),
            "/dev/full: could not be written to its end: No space left on device");
  EXPECT_EQ(input_error([] { RowFile("/dev/null", "a,b").commit(); }), "");
}

}  // namespace
}  // namespace lapservo::internal
