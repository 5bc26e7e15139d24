#include "lapservo/core/new_folder.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::new_folder_test {
namespace fs = std::filesystem;
using testing::input_error;
using testing::TemporaryFolder;

TEST(NewFolder, IsMadeWithItsParentsAndGoneWithThemWhenEmpty) {
  const TemporaryFolder folder;
  {
    const NewFolder made(folder / "a/b/");
    EXPECT_TRUE(fs::is_directory(folder / "a/b"));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(NewFolder, StaysWhereItWasOrHoldsSomething) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "there");
  {
    const NewFolder there(folder / "there"), full(folder / "a/b");
    testing::write_file(folder / "a/b/file", "text");
  }
  EXPECT_TRUE(fs::exists(folder / "there"));
  EXPECT_TRUE(fs::exists(folder / "a/b/file"));
}

TEST(NewFolder, ThatCanNotBeMadeLeavesNothing) {
  const TemporaryFolder folder;
  testing::write_file(folder / "file", "text");
  fs::create_symlink("nowhere", folder / "dangling");
  const auto said = [&](const fs::path& path) { return input_error([&] { const NewFolder made(path); }); };
  for (const char* name : {"file", "file/a", "dangling", "new/../file"})
    EXPECT_TRUE(said(folder / name).starts_with((folder / name).string() + ": can't be made a folder: ")) << name;
  EXPECT_FALSE(fs::exists(folder / "new"));
  EXPECT_EQ(said("/proc/nowhere"), "/proc/nowhere: can't be made a folder: No such file or directory");
  EXPECT_EQ(said(""), "output: has no name, expected a folder to write");
}

}  // namespace lapservo::internal::new_folder_test
