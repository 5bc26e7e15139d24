#include "lapservo/core/row_file.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::row_file_test {
namespace fs = std::filesystem;
using namespace testing;

TEST(RowFile, WithoutCommitNothingIsLeft) {
  const TemporaryFolder folder;
  { RowFile(folder / "o.csv", "a,b").add("1,2"); }
  EXPECT_TRUE(fs::is_empty(folder.path()));
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
  testing::write_file(folder / "elsewhere", "a,b\n"), fs::create_symlink("elsewhere", path + ".part");
  EXPECT_EQ(said(), refusal);
  fs::remove(path + ".part"), fs::create_directory(path + ".part");
  EXPECT_EQ(said(), refusal);
}

TEST(RowFile, LeftUnfinishedOrWithoutItsNameItReplacesNothingAndStays) {
  const TemporaryFolder folder;
  testing::write_file(folder / "o.csv", "earlier");
  RowFile file(folder / "o.csv", "a,b");
  file.add("1,2");
  EXPECT_EQ(file.leave(), folder / "o.csv.part");
  EXPECT_EQ(read_file(folder / "o.csv"), "earlier");
  EXPECT_EQ(read_file(folder / "o.csv.part"), "a,b\n1,2\n");
  const std::string path = (folder / "b.csv").string();
  const auto write = [&] {
    RowFile blocked(path, "a,b");
    blocked.add("1,2"), fs::create_directory(path), blocked.commit();
  };
  EXPECT_EQ(input_error(write),
            path + ": can't be written: Is a directory; what was to be there is in " + path + ".part");
  EXPECT_EQ(read_file(path + ".part"), "a,b\n1,2\n");
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

}  // namespace lapservo::internal::row_file_test
