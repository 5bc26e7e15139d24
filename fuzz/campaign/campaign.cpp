// Images, videos and command lines as hostile, unlucky and impatient users bring them, made by mutations of good ones.
// Prints the counts of their results; exits with 1 when a law is broken. campaign IMAGES COMMANDS [SEED]: case i has
// the seed SEED + i, so a long campaign can be run in parts and one case again by its seed.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <sys/resource.h>
#include <sys/wait.h>
#include <vector>

#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "fuzz/require_observation.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/vision/tracker.h"

namespace {
using namespace lapservo;
using namespace lapservo::internal;
namespace fs = std::filesystem;

constexpr double longest_s = LAPSERVO_CAMPAIGN_LONGEST_S;  // a case may compute
constexpr int tool_longest_s = 120;                        // a command may take, on a busy machine, before it hangs
constexpr int progress_every = 100;                        // cases
constexpr double largest_error_rad = 0.1;

// Computed by this process and the commands that it ran: other work on the machine makes nothing of it longer.
double computed_s() {
  double sum_s = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    ::getrusage(who, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      sum_s += static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  }
  return sum_s;
}

std::size_t below(std::size_t count, Random& random) {
  return random.bits() % std::max<std::size_t>(count, 1);
}

// Bytes with one to three accidents of disks and networks: a bit flipped, a stretch lost, doubled or zeroed.
std::string mutated_bytes(std::string bytes, Random& random) {
  for (std::uint64_t n = 1 + random.bits() % 3; n > 0 && !bytes.empty(); --n) {
    const std::size_t at = below(bytes.size(), random);
    const std::size_t length = std::min(1 + below(400, random), bytes.size() - at);
    switch (random.bits() % 5) {
      case 0:
        bytes.erase(at, length);
        break;
      case 1:
        bytes.insert(at, bytes.substr(at, length));
        break;
      case 2:
        std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), length, '\0');
        break;
      default:
        bytes[at] = static_cast<char>(bytes[at] ^ static_cast<char>(1U << random.bits() % 8));
    }
  }
  return bytes;
}

// The results of the cases of one kind.
class Counts {
 public:
  explicit Counts(std::string kind) : kind_(std::move(kind)) {}
  ~Counts() { show(); }
  // Runs one case; `seed` is what repeats it.
  void add(std::uint64_t seed, const std::function<std::string()>& one) {
    const double start_s = computed_s();
    ++counts_[one()];
    const double took_s = computed_s() - start_s;
    slowest_s_ = std::max(slowest_s_, took_s);
    if (took_s > longest_s) broken(seed, "computes longer than " + std::to_string(longest_s) + " s");
    if (++cases_ % progress_every == 0) show();  // of a campaign that is stopped, what it found
  }
  void broken(std::uint64_t seed, const std::string& law) {
    ++counts_["BROKEN"];
    std::printf("%s, seed %llu: %s\n", kind_.c_str(), static_cast<unsigned long long>(seed), law.c_str());
    any_broken = true;
  }
  inline static bool any_broken = false;

 private:
  void show() const {
    std::printf("%s, %d cases:", kind_.c_str(), cases_);
    for (const auto& [word, count] : counts_) std::printf(" %d %s", count, word.c_str());
    std::printf("; longest %.2f s\n", slowest_s_);
    std::fflush(stdout);
  }

  std::string kind_;
  std::map<std::string, int> counts_;
  int cases_ = 0;
  double slowest_s_ = 0;
};

// Files of good frames, and psi in each of their frames.
struct Sample {
  std::string extension, bytes;
  std::vector<double> psi_rad;
};

std::vector<Sample> samples(const Rig& rig, const fs::path& folder) {
  const Instrument& instrument = rig.instruments.front();
  Renderer renderer(rig.camera, {shaft_of(instrument)}, make_tissue(rig.camera.width_px, rig.camera.height_px, 1));
  std::vector<cv::Mat> frames;
  std::vector<double> psi_rad;
  for (int i = 0; i < 6; ++i) {
    JointVector q = configuration_through(*instrument.camera_from_rcm, {-0.012, 0.004, 0.1}).value();
    q.psi_rad = 1 + 0.1 * i;
    frames.push_back(renderer.render({placement_of(instrument, q)}, 7));
    psi_rad.push_back(q.psi_rad);
  }
  std::vector<Sample> all;
  const auto add = [&](const std::string& extension, const std::vector<double>& shown_rad, const auto& write) {
    const fs::path path = folder / ("sample" + extension);
    write(path.string());
    all.push_back({extension, lapservo::testing::read_file(path), shown_rad});
    fs::remove(path);
  };
  for (const char* extension : {".png", ".jpg", ".bmp", ".webp", ".ppm"})
    add(extension, {psi_rad[0]}, [&](const std::string& path) { cv::imwrite(path, frames[0]); });
  add(".mkv", psi_rad, [&](const std::string& path) {  // H.264
    VideoWriter video(path, 25);
    for (const cv::Mat& frame : frames) video.add(frame);
    video.commit();
  });
  for (const auto& [extension, code] : {std::pair(".mp4", "mp4v"), {".avi", "MJPG"}, {".ts", "mp4v"}})
    add(extension, psi_rad, [&, code = code](const std::string& path) {
      cv::VideoWriter video(path, cv::CAP_FFMPEG, cv::VideoWriter::fourcc(code[0], code[1], code[2], code[3]), 25,
                            frames[0].size());
      for (const cv::Mat& frame : frames) video.write(frame);
    });
  return all;
}

// Frames of a damaged file are not where the truth has them once one is lost: the nearest of the truth's counts.
double min_error_rad(double psi_rad, const std::vector<double>& truth) {
  double least = pi;
  for (const double true_rad : truth) least = std::min(least, std::abs(std::remainder(psi_rad - true_rad, two_pi)));
  return least;
}

std::string track_file(const fs::path& path, const Rig& rig, const Sample& sample, Counts& counts, std::uint64_t seed) {
  std::string worst = "nothing found";
  try {
    Tracker tracker(rig, {.single = true});
    const auto source = open_frame_source(path.string(), 30);
    while (const auto frame = source->next()) {
      if (frame->flaw) {
        worst = "flagged";
        continue;
      }
      for (const Observation& seen : tracker.track(frame->bgr)) {
        fuzz::require_sound(seen);
        if (seen.status != Status::ok) continue;
        if (worst == "nothing found") worst = "measured";
        if (!seen.rcm) continue;  // a shaft that misses the RCM, rows being shifted, has no q
        const double error_rad = min_error_rad(seen.rcm->q.psi_rad, sample.psi_rad);
        if (error_rad > largest_error_rad)
          counts.broken(seed, sample.extension + ": ok with psi off by " + std::to_string(error_rad) + " rad");
      }
    }
    return worst;
  } catch (const InputError& error) {
    fuzz::require_one_line(error);
    return "refused";
  }
}

void try_pictures(int count, std::uint64_t seed) {
  Counts counts("images and videos");
  const lapservo::testing::TemporaryFolder folder;
  const Rig rig = lapservo::testing::small_test_rig();
  const std::vector<Sample> good = samples(rig, folder.path());
  for (int i = 0; i < count; ++i) {
    const std::uint64_t own = seed + static_cast<std::uint64_t>(i);
    counts.add(own, [&] {
      Random random(own);
      const Sample& sample = good[below(good.size(), random)];
      const fs::path path = folder / ("a" + sample.extension);
      lapservo::testing::write_file(path, mutated_bytes(sample.bytes, random));
      return track_file(path, rig, sample, counts, own);
    });
  }
}

// One subcommand with some of its options, each with a value that may be anything.
std::string random_command(const std::string& rig, const std::string& out, Random& random) {
  static const std::vector<std::string> values{"nan", "-1",  "0",   "1",    "1e999", "''", "'a b'", "1,2,3,4", "1,2",
                                               "x",   "0.5", "png", "/dev", "--",    "1x", "9e9",   "6",       "3"};
  const std::vector<std::pair<std::string, std::vector<std::string>>> commands{
      {"render --count 1 --rig " + rig + " --out " + out,
       {"seed", "light", "smoke", "blood", "noise", "blur-px", "motion", "film-mm", "fps", "format", "poses",
        "background"}},
      {"marker design --out " + out,
       {"diameter-mm", "length-mm", "hues", "bands-upper-mm", "bands-lower-mm", "focal-px", "distance-mm", "sigma-px"}},
      {"marker print --rig " + rig + " --out " + out + ".svg", {"paper", "copies", "instrument"}},
      {"marker show --rig " + rig, {"instrument", "focal-px", "distance-mm"}},
      {"servo --robot sim --duration 0.1 --rig " + rig + " --out " + out,
       {"set-point", "via", "method", "controller", "delay-ms", "rcm-px", "start", "seed", "latency-ms", "fps", "hide",
        "trajectory", "replay"}},
      {"estimate-rcm " + rig + " --out " + out, {"sigma-px", "common-px", "rig"}},
      {"track " + rig + " --out " + out, {"rig", "method", "fps", "overlay"}},
      {"experiment none --out " + out, {"seed", "method", "rig"}}};
  const auto& [command, options] = commands[below(commands.size(), random)];
  std::string text = command;
  for (std::uint64_t n = random.bits() % 4; n > 0; --n) {
    text += " --" + options[below(options.size(), random)];
    if (random.bits() % 8 != 0) text += " " + values[below(values.size(), random)];
  }
  return text;
}

void try_commands(int count, std::uint64_t seed) {
  Counts counts("command lines");
  const std::string rig = (lapservo::testing::source_folder() / "configs" / "paper.yaml").string();
  for (int i = 0; i < count; ++i) {
    const std::uint64_t own = seed + static_cast<std::uint64_t>(i);
    counts.add(own, [&]() -> std::string {
      Random random(own);
      const lapservo::testing::TemporaryFolder folder;
      fs::create_directory(folder / "in");
      const std::string arguments = random_command(rig, (folder / "out").string(), random);
      const std::string log = (folder / "in/stderr").string();
      const std::string command = "cd " + (folder / "in").string() + " && ASAN_OPTIONS=detect_leaks=0 timeout " +
                                  std::to_string(tool_longest_s) + " " LAPSERVO_TOOL " " + arguments +
                                  " >/dev/null 2>" + log + " </dev/null";
      const int status = std::system(command.c_str());
      const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
      if (code < 0 || code > 2) counts.broken(own, "exit " + std::to_string(code) + ": " + arguments);
      const std::string said = lapservo::testing::read_file(log);
      if (code == 2 && std::count(said.begin(), said.end(), '\n') != 1)
        counts.broken(own, "not one line: " + arguments + ": " + said);
      for (const auto& entry : fs::directory_iterator(folder.path()))
        if (entry.path().filename() != "in" && (code == 2 || !entry.path().filename().string().starts_with("out")))
          counts.broken(own, "leaves " + entry.path().filename().string() + ": " + arguments);
      return "exit " + std::to_string(code);
    });
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return std::fputs("campaign IMAGES COMMANDS [SEED]\n", stderr), 2;
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);
  const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  try_pictures(std::atoi(argv[1]), seed);
  try_commands(std::atoi(argv[2]), seed);
  return Counts::any_broken ? 1 : 0;
}
