// The tool's output files: no file of anybody is lost, no success is claimed falsely, and measurements survive a killed
// process.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <string>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "acceptance/tool_test.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::outputs_test {
namespace fs = std::filesystem;
using testing::read_file;
using testing::write_file;

class Outputs : public acceptance::ToolTest {
 protected:
  void render(const std::string& more = "") { expect_done("render --rig " + rig_ + " --out frames --count 2" + more); }

  // Starts the tool, kills it when `far_enough`, says whether it came that far.
  static bool killed_when(const std::string& arguments, const std::function<bool()>& far_enough) {
    testing::Process tool(LAPSERVO_TOOL, testing::words_of(arguments), "killed.txt");
    bool reached = false;
    testing::wait_for([&] { return !tool.running() || (reached = far_enough()); });
    return reached;
  }
  static long lines_in(const fs::path& path) {
    const std::string text = read_file(path);
    return std::count(text.begin(), text.end(), '\n');
  }

  const std::string rig_ = "configs/example.yaml";
  const std::string servo_ = "servo --rig configs/paper.yaml --robot sim --set-point 0.9,795,365,212 --seed 2 ";
};

// A file as every subcommand that writes one treats it.
TEST_F(Outputs, OfEveryCommandKeepLinksModesAndDevices) {
  render();
  expect_done("track frames --out obs.csv");
  const std::vector<std::pair<std::string, std::string>> commands{
      {"track frames --out ", ".csv"},
      {"track frames/0000.png --out one.csv --overlay ", ".png"},
      {"estimate-rcm obs.csv --out ", ".csv"},
      {"marker design --out ", ".yaml"},
      {"marker print --rig " + rig_ + " --out ", ".pdf"},
      {"marker show --rig " + rig_ + " --out ", ".svg"},
      {"marker show --rig " + rig_ + " --out ", ".png"}};
  for (const auto& [command, extension] : commands) {
    SCOPED_TRACE(command + extension);
    const std::string name = "out/a" + extension, link = "out/link" + extension, fifo = "out/fifo" + extension;
    write_file(name, "old");
    ::chmod(name.c_str(), 0640);
    fs::create_symlink("a" + extension, link);
    fs::create_symlink("b" + extension, "out/dangling" + extension);
    expect_done(command + link);
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_GT(fs::file_size(name), 10U);
    EXPECT_EQ(fs::status(name).permissions(), fs::perms(0640));
    expect_refused(command + "out/dangling" + extension, {"dangling" + extension, "is a link to no file"});
    EXPECT_TRUE(fs::is_symlink("out/dangling" + extension));

    ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
    expect_done(command + fifo, "cat " + fifo + " >piped & ");
    EXPECT_TRUE(fs::is_fifo(fifo));
    fs::create_symlink("/dev/null", "out/null" + extension);
    expect_done(command + "out/null" + extension);
    EXPECT_TRUE(fs::is_character_file("/dev/null"));
    fs::create_symlink("/dev/full", "out/full" + extension);
    expect_refused(command + "out/full" + extension, {"full" + extension, "No space left on device"});

    for (const auto& entry : fs::directory_iterator("out"))
      EXPECT_NE(entry.path().extension(), ".part") << entry.path();
    fs::remove_all("out"), fs::create_directory("out"), fs::remove("piped");
  }
}

TEST_F(Outputs, NeverGoOverInputs) {
  write_file(
      "cam.yaml",
      "image_width: 1280\nimage_height: 720\ncamera_matrix: {data: [1100, 0, 639.5, 0, 1100, 359.5, 0, 0, 1]}\n");
  const std::string text = read_file(rig_);
  write_file("rig.yaml", "camera: cam.yaml\n" + text.substr(text.find("instruments:")));
  expect_done("render --rig rig.yaml --out frames --count 2");
  fs::copy("rig.yaml", "frames/0000.rig.yaml");
  fs::copy("cam.yaml", "frames/cam.yaml");
  expect_done("track frames --out obs.csv");
  fs::create_hard_link("rig.yaml", "hard.yaml");
  fs::create_symlink("frames/0001.png", "soft.png");
  fs::create_directory("mixed");
  fs::create_symlink("../frames/0001.png", "mixed/0000.png");
  const auto snapshot = [] {
    std::string all;
    for (const auto& entry : fs::recursive_directory_iterator("."))
      if (const std::string name = entry.path().filename();
          entry.is_regular_file() && name != "stdout" && name != "stderr")
        all += entry.path().string() + read_file(entry.path());
    return all;
  };
  const std::string before = snapshot();
  for (const char* arguments :
       {"track frames --rig rig.yaml --out rig.yaml", "track frames --rig rig.yaml --out ./hard.yaml",
        "track frames --rig rig.yaml --out cam.yaml", "track frames --out frames/rig.yaml",
        "track frames --out frames/0000.rig.yaml", "track frames --out frames/cam.yaml", "track frames --out soft.png",
        "track frames --overlay frames/", "track frames --overlay mixed", "track frames/0001.png --overlay soft.png",
        "track frames/0001.png --overlay mixed", "estimate-rcm obs.csv --out obs.csv",
        "estimate-rcm obs.csv --rig rig.yaml --out cam.yaml", "marker show --rig rig.yaml --out cam.yaml",
        "marker print --rig rig.yaml --out hard.yaml", "render --rig frames/rig.yaml --out frames --force",
        "render --rig rig.yaml --out . --force",
        "render --rig rig.yaml --background frames/0000.png --out frames --force",
        "experiment rcm --rig rig.yaml --out . --force"})
    expect_refused(arguments, {"input"});
  for (const char* arguments :
       {"track frames --out same --overlay ./same", "align frames --rig rig.yaml --out same --report ./same",
        "calibrate registration frames --rig rig.yaml --out same --base-frame same"})
    expect_refused(arguments, {"two results"});
  for (const char* arguments : {"track frames/0001.png --out frames/rig.yaml", "track frames --out new.mp4",
                                "check frames --rig rig.yaml --out new.csv"})
    expect_refused(arguments, {"one that ends in"});
  for (const char* step : {"marker frames", "camera frames --board 9x6 --square-mm 5"})
    expect_refused(std::string("calibrate ") + step + " --rig rig.yaml --out cam.yaml", {"a whole rig would replace"});
  expect_refused("marker design --diameter-mm 8.4 --distance-mm 100 --out rig.yaml", {"is a rig", "marker"});
  EXPECT_EQ(snapshot(), before);
  fs::remove("frames/0000.rig.yaml"), fs::create_symlink("gone.yaml", "frames/0000.rig.yaml");
  expect_refused("track frames --out new.csv", {"frames/0000.rig.yaml: is a link to no file"});
}

TEST_F(Outputs, FoldersOfARunAreReplacedOnlyWhenAsked) {
  render();
  const std::string first = read_file("frames/0000.png");
  expect_refused("render --rig " + rig_ + " --out frames/ --count 1", {"frames/", "--force"});
  expect_refused("render --rig " + rig_ + " --out frames/. --count 1", {"--force"});
  expect_refused(servo_ + "--out frames --duration 0.1", {"--force"});
  expect_refused("experiment rcm --out frames", {"--force"});
  EXPECT_EQ(read_file("frames/0000.png"), first);
  fs::create_directory("frames.part");
  write_file("frames.part/mine", "mine"), write_file("frames/notes.txt", "mine");
  fs::create_symlink("frames", "link");
  const std::vector<std::string> same{"frames/", "frames/../frames", "link", "link/", fs::current_path() / "frames"};
  for (const std::string& path : same) {
    expect_done("render --rig " + rig_ + " --seed 2 --count 1 --force --out " + path);
    EXPECT_TRUE(fs::exists("frames/0000.png") && !fs::exists("frames/0001.png")) << path;
    EXPECT_NE(read_file("frames/0000.png"), first);
  }
  EXPECT_TRUE(fs::is_symlink("link"));
  EXPECT_EQ(read_file("frames/notes.txt") + read_file("frames.part/mine"), "minemine");
  EXPECT_EQ(std::distance(fs::directory_iterator("frames"), {}), 5);  // image, truth, rig, notes and the run's mark
  write_file("frames/0001.png", "mine");
  expect_refused("render --rig " + rig_ + " --seed 3 --count 2 --force --out frames",
                 {"frames/0001.png", "the results are in frames/unfinished"});
  EXPECT_EQ(read_file("frames/0001.png"), "mine");
  EXPECT_TRUE(fs::exists("frames/unfinished/0001.png"));
  fs::remove("frames/0001.png");
  expect_done("render --rig " + rig_ + " --seed 3 --count 2 --force --out frames");
  EXPECT_FALSE(fs::exists("frames/unfinished"));
}

// A run that is killed while its results are moved leaves some in either place, and the mark in `unfinished`.
TEST_F(Outputs, OfARunThatWasKilledWhileTheyMovedAreReplaced) {
  render();
  fs::create_directory("frames/unfinished");
  fs::rename("frames/.lapservo-run", "frames/unfinished/.lapservo-run");
  fs::rename("frames/rig.yaml", "frames/unfinished/rig.yaml");
  expect_refused("render --rig " + rig_ + " --out frames --count 1", {"not finished", "--force"});
  expect_done("render --rig " + rig_ + " --out frames --count 1 --force");
  EXPECT_TRUE(fs::exists("frames/0000.png") && fs::exists("frames/rig.yaml"));
  EXPECT_FALSE(fs::exists("frames/0001.png") || fs::exists("frames/unfinished"));
}

TEST_F(Outputs, ForceReplacesNothingThatNoRunHasWritten) {
  fs::create_directories("mine/unfinished");
  write_file("mine/0000.png", "mine"), write_file("mine/truth.csv", "mine"), write_file("mine/rig.yaml", "mine");
  write_file("mine/unfinished/log.csv", "mine");
  for (const std::string& command : {"render --rig " + rig_, servo_, std::string("experiment rcm")}) {
    expect_refused(command + " --force --out mine", {"mine", "expected a new or an empty folder"});
    expect_refused(command + " --force --out out/../stderr", {"stderr"});
  }
  EXPECT_EQ(std::distance(fs::recursive_directory_iterator("mine"), {}), 5);
  EXPECT_EQ(read_file("mine/unfinished/log.csv"), "mine");
  EXPECT_TRUE(fs::is_empty("out"));
}

TEST_F(Outputs, AnEmptyFolderIsTakenAsItIs) {
  fs::permissions("out", fs::perms(0750));
  write_file("out/.hidden", "mine");
  struct stat before {
  }, after{};
  ::stat("out", &before);
  fs::current_path("out");
  EXPECT_EQ(
      std::system((std::string(LAPSERVO_TOOL) + " render --rig ../" + rig_ + " --out . --count 1 >/dev/null").c_str()),
      0);
  fs::current_path("..");
  ::stat("out", &after);
  EXPECT_TRUE(before.st_ino == after.st_ino && before.st_mode == after.st_mode);
  EXPECT_TRUE(fs::exists("out/0000.png") && fs::exists("out/.hidden"));
}

TEST_F(Outputs, ARunsFolderStandsOnItsOwn) {
  const std::string text = read_file("configs/paper.yaml");
  const std::size_t list = text.find("instruments:"), camera = text.find("camera:");
  std::string inlined = text.substr(camera + 7, list - camera - 7);
  write_file("in/cam.yaml", inlined);
  write_file("in/rig.yaml", "camera: cam.yaml\n" + text.substr(list));
  EXPECT_EQ(run("servo --rig in/rig.yaml --robot sim --duration 0.5 --out of_file"), 1) << errors();
  const std::string piped = "cat configs/paper.yaml | " LAPSERVO_TOOL
                            " servo --rig /dev/stdin --robot sim --duration 0.5 --out of_pipe >/dev/null";
  std::system(piped.c_str());
  expect_done("render --rig in/rig.yaml --out frames --count 1");
  fs::remove_all("in");
  for (const char* folder : {"of_file", "of_pipe"}) expect_done(std::string("servo --replay ") + folder + "/log.csv");
  expect_done("track frames --out obs.csv");
  expect_done("track frames --rig of_pipe/rig.yaml --out obs.csv");
  EXPECT_EQ(read_file("of_file/rig.yaml"), read_file("of_pipe/rig.yaml"));
}

TEST_F(Outputs, WhatAKilledTrackMeasuredCanBeFound) {
  expect_done("render --rig " + rig_ + " --out frames --count 30");
  write_file("obs.csv", "old");
  ASSERT_TRUE(
      killed_when("track frames --out obs.csv --overlay out/overlay", [] { return lines_in("obs.csv.part") >= 4; }));
  EXPECT_EQ(read_file("obs.csv"), "old");
  const std::string left = read_file("obs.csv.part");
  EXPECT_EQ(left.back(), '\n');
  for (const std::string of : {"none", "frames --rig none.yaml"})
    expect_refused("track " + of + " --out obs.csv", {of.substr(of.find("none"))});
  EXPECT_EQ(read_file("obs.csv.part"), left) << "by a run that came to nothing";
  expect_done("track frames --out obs.csv --overlay out/overlay");
  EXPECT_EQ(lines_in("obs.csv"), 31);
  EXPECT_FALSE(fs::exists("obs.csv.part"));
  // A frame that ends the run is no reason to lose those before it.
  write_file("frames/0030.ppm", "P6\n2 2\n255\ntwelve bytes");
  expect_refused("track frames --out new.csv", {"0030.ppm: size: is 2x2", "of 30 frames before are in new.csv.part"});
  EXPECT_EQ(lines_in("new.csv.part"), 31);
}

TEST_F(Outputs, WhatAKilledServoLoggedReplays) {
  expect_done(servo_ + "--duration 8 --out run");
  const std::string log = read_file("run/log.csv");
  for (const char* name : {"run", "new"}) {
    const std::string folder = name;
    const fs::path part = folder + "/unfinished/log.csv.part";
    ASSERT_TRUE(killed_when(servo_ + "--duration 600 --force --out " + folder, [&] { return lines_in(part) >= 20; }));
    expect_done("servo --replay " + part.string());
    expect_in(output(), "ticks reproduced bit for bit");
    expect_refused(servo_ + "--duration 8 --out " + folder, {folder, "not finished", "--force"});
  }
  EXPECT_EQ(read_file("run/log.csv"), log);
  expect_done(servo_ + "--duration 8 --force --out run");
  EXPECT_FALSE(fs::exists("run/unfinished"));
  EXPECT_EQ(read_file("run/log.csv"), log);
}

TEST_F(Outputs, TwoRunsDoNotWriteTheSame) {
  bool refused = false;
  killed_when(servo_ + "--duration 600 --out run", [&] {
    if (lines_in("run/unfinished/log.csv.part") < 2) return false;
    refused = std::system(
                  (std::string(LAPSERVO_TOOL) + " " + servo_ + "--duration 1 --force --out run 2>second").c_str()) != 0;
    return true;
  });
  EXPECT_TRUE(refused);
  EXPECT_EQ(read_file("second"), "lapservo: run: is being written by another run\n");
}

TEST_F(Outputs, AFullDiskIsNoSuccess) {
  expect_done("render --rig " + rig_ + " --out film --video --moving --count 12");
  expect_done("render --rig " + rig_ + " --out frames --count 4");
  const std::string limit = "ulimit -f 60; ";  // KiB or half, by the shell: less than the film, more than the rows
  write_file("overlay.mp4", "old");
  expect_refused("track film/video.mp4 --out obs.csv --overlay overlay.mp4", {"overlay.mp4", "written to its end"},
                 limit);
  EXPECT_EQ(lines_in("obs.csv"), 13) << "the rows are there nevertheless";
  EXPECT_EQ(read_file("overlay.mp4"), "old");
  expect_refused("render --rig " + rig_ + " --out new --video --moving --count 12", {"video.mp4"}, limit);
  expect_refused("render --rig " + rig_ + " --out new --count 2", {"0000.png", "File too large"}, limit);
  EXPECT_FALSE(fs::exists("new"));
  expect_refused("track frames --out o.csv --overlay out/new", {"0000.png", "File too large"}, limit);
  EXPECT_FALSE(fs::exists("o.csv") || fs::exists("o.csv.part"));
  EXPECT_TRUE(fs::is_empty("out"));
  EXPECT_EQ(run(servo_ + "--duration 8 --out run", limit), 1);
  expect_in(errors(), "the rows before are in run/unfinished/log.csv.part: the run goes on without a log");
  expect_in(output(), "within 1 px");
  expect_done("servo --replay run/unfinished/log.csv.part");
  EXPECT_EQ(run("marker show --rig " + rig_ + " >/dev/full 2>stderr; true #"), 0);
  expect_in(errors(), "standard output");
}

TEST_F(Outputs, AFolderThatCanNotBeWrittenIsSaidBeforeTheWork) {
  render();
  fs::create_directory("read_only");
  const bool root = ::geteuid() == 0;  // may write everywhere but on what is mounted for reading
  if (root && ::mount("tmpfs", "read_only", "tmpfs", MS_RDONLY, "size=1m") != 0) GTEST_SKIP() << "needs to mount";
  if (!root) fs::permissions("read_only", fs::perms(0500));
  const std::vector<std::string> folders{"render --rig " + rig_ + " --out ", servo_ + "--out ", "experiment all --out ",
                                         "track frames --overlay "};
  for (const std::string& command : folders)
    for (const char* end : {"read_only", "read_only/a"}) expect_refused(command + end, {"read_only"});
  for (const char* command : {"track frames --out ", "marker design --out ", "track frames/0000.png --overlay "})
    expect_refused(std::string(command) + "read_only/a.png", {"read_only/a.png"});
  for (const char* command : {"calibrate all --report ", "check frames --out "})
    expect_refused(command + ("read_only/a.html --rig " + rig_), {"a.html: can't be written"});
  EXPECT_EQ(output(), "");
  if (root) ::umount("read_only");
}

TEST_F(Outputs, StandardOutputIsWrittenIntoWhereverItGoes) {
  render();
  const std::string tool = std::string(LAPSERVO_TOOL) + " track frames --out ";
  std::system((tool + "/dev/stdout >red 2>stderr").c_str());
  EXPECT_TRUE(read_file("red").starts_with("frame,time_s")) << errors();
  EXPECT_EQ(lines_in("red"), 7) << "two rows, and what the tool says";
  write_file("red", "old\n");
  std::system((tool + "/proc/self/fd/1 >>red 2>stderr").c_str());
  EXPECT_EQ(lines_in("red"), 8) << "nothing that was there is lost";
  std::system((tool + "/dev/stdout 2>stderr | cat >piped").c_str());
  EXPECT_TRUE(read_file("piped").starts_with("frame,time_s"));
  std::system((tool + "closed.csv >&- 2>&-").c_str());
  EXPECT_EQ(lines_in("closed.csv"), 3);
}

}  // namespace lapservo::internal::outputs_test
