#include "lapservo/core/atomic_file.h"

#include <csignal>
#include <fcntl.h>
#include <filesystem>
#include <string>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;
using testing::input_error;
using testing::read_file;

int files_in(const testing::TemporaryFolder& folder) {
  return static_cast<int>(std::distance(fs::directory_iterator(folder.path()), fs::directory_iterator()));
}

TEST(AtomicFile, AppearsWholeOnCommitAndNotBefore) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder / "out.csv";
  {
    AtomicFile file(path);
    file.stream() << "a,b\n";
    file.stream().flush();
    EXPECT_FALSE(fs::exists(path));
    file.commit();
    EXPECT_EQ(read_file(path), "a,b\n");
  }
  EXPECT_EQ(read_file(path), "a,b\n");
  EXPECT_EQ(files_in(folder), 1);
}

TEST(AtomicFile, WithoutCommitWhatStoodThereStays) {
  const testing::TemporaryFolder folder;
  const fs::path path = folder / "out.csv";
  testing::write_file(path, "old");
  { AtomicFile(path).stream() << "new"; }
  EXPECT_EQ(read_file(path), "old");
  EXPECT_EQ(files_in(folder), 1);
}

TEST(AtomicFile, CommitReplacesWhatStoodThere) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "out.csv", "something longer");
  AtomicFile file(folder / "out.csv");
  file.stream() << "new";
  file.commit();
  EXPECT_EQ(read_file(folder / "out.csv"), "new");
}

TEST(AtomicFile, RefusesAFolderAndAMissingFolderAtConstruction) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(input_error([&] { AtomicFile(folder.path()); }),
            folder.path().string() + ": is a folder, expected a file to write");
  EXPECT_EQ(input_error([&] { AtomicFile(folder / "none/out.csv"); }),
            (folder / "none/out.csv").string() + ": can't be written: No such file or directory");
  EXPECT_EQ(files_in(folder), 0);
}

TEST(AtomicFile, AFullDiskIsAnErrorAndKeepsWhatStoodThere) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder / "out.csv").string();
  testing::write_file(path, "old");
  const auto previous = std::signal(SIGXFSZ, SIG_IGN);
  struct rlimit old {};
  ::getrlimit(RLIMIT_FSIZE, &old);
  const struct rlimit small { 10, old.rlim_max };
  ::setrlimit(RLIMIT_FSIZE, &small);
  const std::string said = input_error([&] { write_file(path, "longer than ten bytes"); });
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, previous);
  EXPECT_EQ(said, path + ": could not be written to its end: File too large");
  EXPECT_EQ(read_file(path), "old");
  EXPECT_EQ(files_in(folder), 1);
}

TEST(AtomicFile, KeepsLinksAndModes) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "real.csv", "old");
  fs::permissions(folder / "real.csv", fs::perms(0640));
  fs::create_symlink("real.csv", folder / "link.csv");
  write_file(folder / "link.csv", "new");
  EXPECT_TRUE(fs::is_symlink(folder / "link.csv"));
  EXPECT_EQ(read_file(folder / "real.csv"), "new");
  EXPECT_EQ(fs::status(folder / "real.csv").permissions(), fs::perms(0640));
  EXPECT_EQ(files_in(folder), 2);
}

TEST(AtomicFile, ANewFileHasTheUsersMask) {
  const testing::TemporaryFolder folder;
  const mode_t before = ::umask(027);
  write_file(folder / "new.csv", "new");
  ::umask(before);
  EXPECT_EQ(fs::status(folder / "new.csv").permissions(), fs::perms(0640));
}

TEST(AtomicFile, WritesIntoWhatIsNoRegularFile) {
  const testing::TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  const FileDescriptor reader(::open((folder / "fifo").c_str(), O_RDONLY | O_NONBLOCK));
  write_file(folder / "fifo", "text");
  char text[8] = {};
  EXPECT_EQ(::read(reader.number(), text, sizeof text), 4);
  EXPECT_STREQ(text, "text");
  EXPECT_TRUE(fs::is_fifo(folder / "fifo"));
  write_file("/dev/null", "text");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  EXPECT_EQ(input_error([] { write_file("/dev/full", "text"); }),
            "/dev/full: could not be written to its end: No space left on device");
}

}  // namespace
}  // namespace lapservo::internal
