#include "lapservo/core/output_target.h"

#include <filesystem>
#include <string>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;
using testing::input_error;
using testing::TemporaryFolder;

std::string refusal_to_write(const fs::path& path) {
  return input_error([&] { output_target(path); });
}

TEST(OutputTarget, FollowsLinksToFilesThatAreThereOrNot) {
  const TemporaryFolder folder;
  fs::create_directory(folder / "sub");
  testing::write_file(folder / "sub/there.csv", "old");
  fs::create_symlink("sub/there.csv", folder / "first");
  fs::create_symlink(folder / "first", folder / "second");
  fs::create_symlink("sub/missing.csv", folder / "dangling");
  EXPECT_TRUE(fs::equivalent(output_target(folder / "second").file, folder / "sub/there.csv"));
  EXPECT_TRUE(output_target(folder / "second").existing);
  EXPECT_EQ(output_target(folder / "dangling").file, folder / "sub/missing.csv");
  EXPECT_FALSE(output_target(folder / "dangling").existing);
  fs::create_symlink("loop", folder / "loop");
  EXPECT_EQ(refusal_to_write(folder / "loop"),
            (folder / "loop").string() + ": can't be written: Too many levels of symbolic links");
}

TEST(OutputTarget, KnowsWhatIsNoRegularFile) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "fifo").c_str(), 0600), 0);
  for (const fs::path& path : {fs::path("/dev/null"), fs::path("/dev/full"), fs::path("/dev/stdout"), folder / "fifo"})
    EXPECT_TRUE(output_target(path).is_stream) << path;
}

TEST(OutputTarget, RefusesWhatCanNotBeAFile) {
  const TemporaryFolder folder;
  const std::string place = folder.path().string();
  EXPECT_EQ(refusal_to_write(""), "output: has no name, expected a file to write");
  EXPECT_EQ(refusal_to_write(folder.path()), place + ": is a folder, expected a file to write");
  EXPECT_EQ(refusal_to_write(place + "/"), place + "/: is a folder, expected a file to write");
  EXPECT_EQ(refusal_to_write(place + "/none/"), place + "/none/: is a folder's name, expected a file to write");
  testing::write_file(folder / "file", "");
  EXPECT_EQ(refusal_to_write(folder / "file/x"), place + "/file/x: can't be written: Not a directory");
  const FileDescriptor listening(::socket(AF_UNIX, SOCK_STREAM, 0));
  sockaddr_un address{AF_UNIX, {}};
  (folder / "socket").string().copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(listening.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(refusal_to_write(folder / "socket"), place + "/socket: is a socket, expected a file to write");
}

TEST(OutputTarget, AFileThatMayNotBeWrittenIsNotReplaced) {
  if (::geteuid() == 0) GTEST_SKIP() << "root may write everything";
  const TemporaryFolder folder;
  testing::write_file(folder / "precious.csv", "old");
  fs::permissions(folder / "precious.csv", fs::perms::owner_read);
  EXPECT_EQ(refusal_to_write(folder / "precious.csv"),
            (folder / "precious.csv").string() + ": can't be written: Permission denied");
}

}  // namespace
}  // namespace lapservo::internal
