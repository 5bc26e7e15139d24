#include "lapservo/core/input_file.h"

#include <chrono>
#include <fcntl.h>
#include <string>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::internal::input_file_test {
namespace fs = std::filesystem;

constexpr std::size_t limit = 1 << 20;

std::string refusal(const fs::path& path) {
  return testing::input_error([&] { read_input(path, limit, "an image"); });
}

TEST(ReadInput, GivesAllBytesUpToTheLimit) {
  const testing::TemporaryFolder folder;
  std::string bytes(limit, '\0');
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 31);
  testing::write_file(folder / "a", bytes);
  EXPECT_EQ(read_input(folder / "a", limit, "an image"), bytes);
  testing::write_file(folder / "b", bytes + "x");
  EXPECT_EQ(refusal(folder / "b"), (folder / "b").string() + ": is larger than 1 MiB, expected an image");
  testing::write_file(folder / "c", "");
  EXPECT_EQ(read_input(folder / "c", limit, "an image"), "");
}

TEST(ReadInput, RefusesWhatHasNoEndAndWhatIsNoFile) {
  const testing::TemporaryFolder folder;
  EXPECT_EQ(refusal("/dev/zero"), "/dev/zero: is larger than 1 MiB, expected an image");
  EXPECT_EQ(refusal(folder.path()), folder.path().string() + ": is a folder, expected an image");
  EXPECT_EQ(refusal(folder / "none"), (folder / "none").string() + ": can't be opened, expected an image");
}

TEST(ReadInput, WaitsForAPipeButNotForEver) {
  const testing::TemporaryFolder folder;
  const fs::path pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer([&] {
    const int out = ::open(pipe.c_str(), O_WRONLY);
    for (const char* part : {"one ", "two"}) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      EXPECT_GT(::write(out, part, std::string(part).size()), 0);
    }
    ::close(out);
  });
  EXPECT_EQ(read_input(pipe, limit, "an image"), "one two");
  writer.join();
  EXPECT_EQ(refusal(pipe), pipe.string() + ": gives nothing for 5 seconds, expected an image");
}

}  // namespace lapservo::internal::input_file_test
