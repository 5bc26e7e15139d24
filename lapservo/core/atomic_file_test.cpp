#include "lapservo/core/atomic_file.h"

#include <filesystem>
#include <string>
#include <sys/stat.h>

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

TEST(AtomicFile, RefusesAFolderAndAMissingFolderAtConstruction) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(input_error([&] { AtomicFile(folder.path()); }),
            folder.path().string() + ": is a folder, expected a file to write");
  EXPECT_EQ(input_error([&] { AtomicFile(folder / "none/out.csv"); }),
            (folder / "none/out.csv").string() + ": can't be written: No such file or directory");
  EXPECT_EQ(files_in(folder), 0);
}

TEST(AtomicFile, ANewFileHasTheUsersMask) {
  const testing::TemporaryFolder folder;
  const mode_t before = ::umask(027);
  write_file(folder / "new.csv", "new");
  ::umask(before);
  EXPECT_EQ(fs::status(folder / "new.csv").permissions(), fs::perms(0640));
}

}  // namespace
}  // namespace lapservo::internal
