#include "lapservo/core/output_target.h"

#include <filesystem>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::output_target_test {
namespace fs = std::filesystem;
using namespace testing;

std::string refusal_to_write(const fs::path& path) {
  return input_error([&] { const OutputTarget target(path); });
}

TEST(OutputTarget, RefusesWhatCanNotBeAFile) {
  const TemporaryFolder folder;
  const std::string place = folder.path().string();
  fs::create_symlink("loop", folder / "loop");
  fs::create_symlink("missing.csv", folder / "dangling");
  testing::write_file(folder / "file", "");
  for (const auto& [path, complaint] : {std::pair<std::string, std::string>{"", ": is a folder"},
                                        {"/", ": is a folder"},
                                        {"/none/", ": is a folder's name"},
                                        {"/dangling", ": is a link to no file"}})
    EXPECT_EQ(refusal_to_write(place + path), place + path + complaint + ", expected a file to write");
  for (const auto& [path, complaint] :
       {std::pair<std::string, std::string>{"/loop", "Too many levels of symbolic links"},
        {"/file/x", "Not a directory"},
        {"/none/x", "No such file or directory"},
        {"/" + std::string(300, 'x'), "File name too long"}})
    EXPECT_EQ(refusal_to_write(place + path), place + path + ": can't be written: " + complaint);
  EXPECT_EQ(refusal_to_write(""), "output: has no name, expected a file to write");
}

TEST(OutputTarget, AFileThatMayNotBeWrittenIsNotReplaced) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everything";
  const TemporaryFolder folder;
  testing::write_file(folder / "precious.csv", "old");
  fs::permissions(folder / "precious.csv", fs::perms::owner_read);
  EXPECT_EQ(refusal_to_write(folder / "precious.csv"),
            (folder / "precious.csv").string() + ": can't be written: Permission denied");
}

TEST(TemporaryFile, IsBesideItsTargetAndGoneInTheEnd) {
  const TemporaryFolder folder;
  testing::write_file(folder / "a.mp4", "old");
  {
    const TemporaryFile file(OutputTarget(folder / "a.mp4"));
    EXPECT_EQ(file.path().parent_path(), fs::canonical(folder.path()));
    EXPECT_EQ(file.path().extension(), ".part");
    EXPECT_TRUE(fs::exists(file.path()));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
  EXPECT_EQ(read_file(folder / "a.mp4"), "old");
}

TEST(TemporaryFile, BecomesANewFileByTheUsersMask) {
  const TemporaryFolder folder;
  const mode_t before = ::umask(027);
  TemporaryFile(OutputTarget(folder / "new.csv")).commit();
  ::umask(before);
  EXPECT_EQ(fs::status(folder / "new.csv").permissions(), fs::perms(0640));
}

TEST(TemporaryFile, OfTwoWritersTheLastIsThereWhole) {
  const TemporaryFolder folder;
  const OutputTarget target(folder / "a.csv");
  TemporaryFile first(target), second(target);
  first.write("first");
  second.write("second");
  second.commit();
  EXPECT_EQ(read_file(folder / "a.csv"), "second");
  first.commit();
  EXPECT_EQ(read_file(folder / "a.csv"), "first");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(TemporaryFile, OfAKilledProcessChangesNothingAndIsInNobodysWay) {
  const TemporaryFolder folder;
  testing::write_file(folder / "a.csv", "old");
  const OutputTarget target(folder / "a.csv");
  const pid_t child = ::fork();
  if (child == 0) {
    TemporaryFile file(target);
    file.write("half");
    ::_exit(0);
  }
  ::waitpid(child, nullptr, 0);
  EXPECT_EQ(read_file(folder / "a.csv"), "old");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 2);
  const std::string of_our_number = target.file.string() + "." + std::to_string(::getpid()) + "-";
  for (int i = 0; i < 100; ++i) testing::write_file(of_our_number + std::to_string(i) + ".part", "half");
  TemporaryFile file(target);
  file.write("new");
  file.commit();
  EXPECT_EQ(read_file(folder / "a.csv"), "new");
}

}  // namespace lapservo::internal::output_target_test
