// hard_frames [FRAMES] [WIDTH HEIGHT] [SEED]: what frames cost in which a marker is searched for long: a table of CPU
// time a frame over moving sequences of two instruments whose markers are clean, bloody, in smoke, hidden, crossing,
// mirrored or not there, drawn from SEED (1). Each run of at most 25 frames is tracked three times, by trackers that do
// the same, and the least of a frame's times counts: what else the machine does is no work of the tracker's.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "bench/frames.h"
#include "lapservo/core/random.h"
#include "lapservo/core/statistics.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::bench {
using namespace internal;
namespace {

double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// A part of a sequence: what lies on the markers and before them.
struct Condition {
  double blood = 0, smoke = 0;
  std::vector<bool> covered{};  // by instrument; not covered when absent
  int instruments = 2;          // that are there
  bool mirrored = false;
  bool crossing = false;
};

struct Sequence {
  const char* name;
  std::vector<Condition> parts;
};

const std::vector<Sequence>& sequences() {
  static const std::vector<Sequence> all{
      {"clean", {{}}},
      {"blood", {{.blood = 0.3}, {.blood = 0.5}, {.blood = 0.7}, {.blood = 0.9}, {.blood = 1.3}}},
      {"smoke", {{.smoke = 0.5}, {.smoke = 0.65}, {.smoke = 0.75}, {.smoke = 0.85}}},
      {"blood, smoke", {{.blood = 0.3, .smoke = 0.4}, {.blood = 0.6, .smoke = 0.5}}},
      {"hidden", {{.covered = {true, false}}, {.blood = 0.6, .covered = {false, true}}, {.covered = {true, true}}}},
      {"crossing", {{.crossing = true}, {.blood = 0.4, .crossing = true}, {.smoke = 0.5, .crossing = true}}},
      {"mirrored", {{.mirrored = true}, {.blood = 0.4, .mirrored = true}}},
      {"another's", {{.covered = {true, true}, .instruments = 3}}},
      {"none", {{.instruments = 0}}}};
  return all;
}

Renderer renderer_of(const Rig& rig, const Condition& condition, std::uint64_t seed) {
  Random random(seed);
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) {
    shafts.push_back(shaft_of(instrument));
    shafts.back().blotches = blood_over(instrument.marker, condition.blood, random);
  }
  RenderOptions options;
  options.smoke = static_cast<float>(condition.smoke);
  return Renderer(rig.camera, std::move(shafts), make_tissue(rig.camera.width_px, rig.camera.height_px, seed), options);
}

// One marker 12 mm behind the other, past which it moves.
std::vector<ShaftPlacement> crossing_placements(const Rig& rig, int index) {
  std::vector<ShaftPlacement> placed;
  for (std::size_t i = 0; i < rig.instruments.size(); ++i) {
    const double side = i == 0 ? 1 : -1, way_m = 0.012 * std::sin(0.1 * index);
    const Eigen::Vector3d point(0.003 + side * way_m, 0.4 * side * way_m, 0.09 + (i == 0 ? 0 : 0.012));
    JointVector q = configuration_through(*rig.instruments[i].camera_from_rcm, point).value();
    q.psi_rad = 0.5 + 0.03 * index;
    placed.push_back(placement_of(rig.instruments[i], q));
  }
  return placed;
}

// The frames of each drawing of blood, one after another.
void for_each_run(cv::Size size_px, const Sequence& sequence, int frames, std::uint64_t seed,
                  const std::function<void(const std::vector<cv::Mat>&)>& look) {
  constexpr int at_most = 25;  // frames of a drawing of blood
  const int runs = std::max(static_cast<int>(sequence.parts.size()), (frames + at_most - 1) / at_most);
  for (int run = 0; run < runs; ++run) {
    const Condition& condition = sequence.parts[static_cast<std::size_t>(run) % sequence.parts.size()];
    const Rig rig = scaled_rig(size_px, condition.instruments);
    Renderer renderer = renderer_of(rig, condition, 1000 * (seed - 1) + static_cast<std::uint64_t>(run) + 1);
    std::vector<cv::Mat> pictures;
    for (int i = 0; i < std::max(1, frames / runs); ++i) {
      const int index = 31 * run + i;
      std::vector<ShaftPlacement> placed =
          condition.crossing ? crossing_placements(rig, index) : placements(rig, index);
      for (std::size_t k = 0; k < std::min(placed.size(), condition.covered.size()); ++k)
        placed[k].covered = condition.covered[k];
      pictures.push_back(renderer.render(placed, static_cast<std::uint64_t>(i)).clone());
      if (condition.mirrored) cv::flip(pictures.back(), pictures.back(), 1);
    }
    look(pictures);
  }
}

struct Times {
  std::vector<double> ms;
  int found = 0, looked_for = 0;

  void print(const std::string& name, double memcpy_ms) const {
    const double worst = quantile_of(ms, 0.999);
    std::printf("| %s | %zu | %.0f %% | %.2f | %.2f | %.2f | %.2f | %.1f |\n", name.c_str(), ms.size(),
                100.0 * found / std::max(1, looked_for), quantile_of(ms, 0.5), quantile_of(ms, 0.99), worst,
                quantile_of(ms, 1), worst / memcpy_ms);
  }
};

double memcpy_ms(cv::Size size_px) {
  const cv::Mat from(size_px, CV_8UC3, cv::Scalar(1, 2, 3));
  cv::Mat to(size_px, CV_8UC3);
  std::vector<double> ms;
  for (int i = 0; i < 51; ++i) {
    const double before = cpu_ms();
    std::memcpy(to.data, from.data, from.total() * from.elemSize());
    ms.push_back(cpu_ms() - before);
  }
  return quantile_of(ms, 0.5);
}

// The frames of a run, by trackers that know the runs before it.
void track(std::array<Tracker, 3>& trackers, const std::vector<cv::Mat>& pictures, Times& times) {
  std::vector<double> ms(pictures.size(), std::numeric_limits<double>::infinity());
  for (Tracker& tracker : trackers)
    for (std::size_t i = 0; i < pictures.size(); ++i) {
      const double before = cpu_ms();
      const std::vector<Observation>& seen = tracker.track(pictures[i]);
      ms[i] = std::min(ms[i], cpu_ms() - before);
      if (&tracker != trackers.data()) continue;
      for (const Observation& o : seen) times.found += o.status == Status::ok;
      times.looked_for += static_cast<int>(seen.size());
    }
  times.ms.insert(times.ms.end(), ms.begin(), ms.end());
}

void measure(cv::Size size_px, int frames, std::uint64_t seed) {
  const double copied_ms = memcpy_ms(size_px);
  std::printf("memcpy of a frame of %dx%d: %.2f ms\n\n", size_px.width, size_px.height, copied_ms);
  std::printf("CPU time of a frame, the least of three replays:\n\n");
  std::printf("| sequence | frames | found | median [ms] | p99 | p99.9 | largest | p99.9 / memcpy |\n");
  std::printf("| --- | --- | --- | --- | --- | --- | --- | --- |\n");
  Times all;
  for (const bool registered : {true, false})
    for (const Sequence& sequence : sequences()) {
      Rig rig = scaled_rig(size_px, 2);
      if (!registered)
        for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
      std::array trackers{Tracker(rig), Tracker(rig), Tracker(rig)};
      Times times;
      for_each_run(size_px, sequence, frames, seed,
                   [&](const std::vector<cv::Mat>& pictures) { track(trackers, pictures, times); });
      times.print(sequence.name + std::string(registered ? "" : ", RCM unknown"), copied_ms);
      std::fflush(stdout);
      all.ms.insert(all.ms.end(), times.ms.begin(), times.ms.end());
      all.found += times.found, all.looked_for += times.looked_for;
    }
  all.print("all", copied_ms);
}

}  // namespace
}  // namespace lapservo::bench

int main(int argc, char** argv) {
  const int frames = argc > 1 ? std::atoi(argv[1]) : 200;
  const cv::Size size_px = argc > 3 ? cv::Size(std::atoi(argv[2]), std::atoi(argv[3])) : cv::Size(1920, 1080);
  const int seed = argc > 4 ? std::atoi(argv[4]) : 1;
  if (frames < 1 || size_px.width < 1 || size_px.height < 1 || seed < 1)
    return std::fputs("hard_frames [FRAMES] [WIDTH HEIGHT] [SEED]\n", stderr), 2;
  lapservo::bench::measure(size_px, frames, static_cast<std::uint64_t>(seed));
}
