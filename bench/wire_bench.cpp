// The closed loop through a robot's wire in real time: the time from an image's arrival to the first setpoint that uses
// it, and the regularity of setpoints. The arm and its camera, 1280x720 at 30 frames/s, are another process. Usage:
// wire_bench ros2|ros1 raw|compressed SECONDS [TICKS_PER_SECOND]

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <sys/prctl.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/core/random.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/image_receiver.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/run.h"
#include "lapservo/sim_robot/sim_robot.h"
#include "transports/named_transport.h"

namespace lapservo::internal {
namespace {

const std::string raw_topic = "/endoscope/image_raw", compressed_topic = raw_topic + "/compressed";

struct Options {
  std::string transport, images;
  double duration_s = 60, ticks_per_s = 120;
};

ControllerConfig controller_of(const Rig& rig, double ticks_per_s) {
  ControllerConfig config;
  config.period_s = 1 / ticks_per_s;
  config.window = image_window(rig.camera, 20);
  return config;
}

volatile std::sig_atomic_t ended = 0;

// The other process: runs until SIGTERM, then writes the setpoints' stamps.
void be_the_arm(const Options& options, const Rig& rig, int to) {
  std::signal(SIGTERM, [](int) { ended = 1; });
  SimulatorConfig simulated;
  simulated.endoscope.latency_s = 0.08;
  simulated.endoscope.frame_rate_hz = 30;
  simulated.endoscope.real_time = true;
  Random random(1);
  const JointVector start = random_start(sinusoids(paper_sinusoids()), 20, feature_model(rig), controller_of(rig, 30),
                                         simulated.arm.joint_offset, random, "the paper's trajectory");
  Simulator simulator(rig, simulated, start);
  const auto transport = named_transport(options.transport, "lapservo_bench_robot");
  SimRobotConfig config;
  SimRobot robot(*transport, rig, simulator, config);
  std::mutex mutex;
  std::vector<double> sent_s;
  auto subscription = transport->subscribe<JointMessage>("/PSM1/servo_jp", [&](JointMessage&& message) {
    const std::lock_guard lock(mutex);
    sent_s.push_back(message.stamp_s);
  });
  const SteadyClock clock;
  for (const double begin_s = clock.now_s(); !ended;) {
    robot.advance(clock.now_s() - begin_s);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  subscription.reset();
  for (const char *at = reinterpret_cast<const char*>(sent_s.data()), *const end = at + sizeof(double) * sent_s.size();
       at < end;)
    at += std::max<ssize_t>(0, ::write(to, at, static_cast<std::size_t>(end - at)));
}

// Images, and when each arrived, by the transport's clock.
class TimedImages : public ImageStream {
 public:
  TimedImages(Transport& transport, const Rig& rig, const Options& options)
      : transport_(transport), receiver_(rig.camera.width_px, rig.camera.height_px) {
    const auto receive = [this](auto&& message) {
      const std::lock_guard lock(mutex_);
      arrival_s_ = transport_.stamp_now_s();
      receiver_.receive(std::move(message), clock_.now_s());
    };
    subscription_ = options.images == "raw" ? transport.subscribe<ImageMessage>(raw_topic, receive)
                                            : transport.subscribe<CompressedImageMessage>(compressed_topic, receive);
  }

  std::optional<StampedImage> newest() override {
    double arrival_s = 0;
    {
      const std::lock_guard lock(mutex_);
      arrival_s = arrival_s_;
    }
    auto image = receiver_.newest();
    const std::lock_guard lock(mutex_);
    if (image) arrivals_s_[image->time_s] = arrival_s;
    return image;
  }
  double arrival_s(double time_s) const {
    const std::lock_guard lock(mutex_);
    return arrivals_s_.at(time_s);
  }
  std::string counts() const { return receiver_.counts().text(); }

 private:
  Transport& transport_;
  SteadyClock clock_;
  ImageReceiver receiver_;
  mutable std::mutex mutex_;
  double arrival_s_ = 0;
  std::map<double, double> arrivals_s_;
  Transport::Subscription subscription_;
};

// When images had been taken into account.
class Watcher : public RunObserver {
 public:
  Watcher(const Transport& transport, const TimedImages& images) : transport_(transport), images_(images) {}
  bool on_tick(const ControlTick& tick) override {
    if (tick.seen && tick.decision.send)
      seen_.push_back({images_.arrival_s(tick.seen->image.time_s), transport_.stamp_now_s()});
    return true;
  }
  struct Seen {
    double arrival_s = 0, decided_s = 0;
  };
  const std::vector<Seen>& seen() const { return seen_; }

 private:
  const Transport& transport_;
  const TimedImages& images_;
  std::vector<Seen> seen_;
};

void print(const char* what, std::vector<double> values_s) {
  if (values_s.empty()) throw std::runtime_error(std::string("no ") + what);
  std::sort(values_s.begin(), values_s.end());
  const auto quantile_ms = [&](double q) {
    return 1e3 * values_s[static_cast<std::size_t>(q * static_cast<double>(values_s.size() - 1))];
  };
  std::printf("  %-32s median %6.2f  p99 %6.2f  largest %6.2f ms  (%zu)\n", what, quantile_ms(0.5), quantile_ms(0.99),
              quantile_ms(1), values_s.size());
}

void report(const std::vector<Watcher::Seen>& seen, const std::vector<double>& sent_s) {
  std::vector<double> periods_s, waits_s, decisions_s;
  for (std::size_t i = 1; i < sent_s.size(); ++i) periods_s.push_back(sent_s[i] - sent_s[i - 1]);
  for (const auto& [arrival_s, decided_s] : seen) {
    const auto sent = std::lower_bound(sent_s.begin(), sent_s.end(), decided_s);
    if (sent == sent_s.end()) continue;
    waits_s.push_back(*sent - arrival_s);
    decisions_s.push_back(decided_s - arrival_s);
  }
  print("image arrival to decision", decisions_s);
  print("image arrival to setpoint out", waits_s);
  print("setpoint period", periods_s);
}

// The setpoints' stamps: their send times by the computer's clock.
std::vector<double> stamps_of(pid_t arm, int from) {
  ::kill(arm, SIGTERM);
  std::vector<double> stamps_s;
  const std::unique_ptr<FILE, decltype(&std::fclose)> file(::fdopen(from, "r"), std::fclose);
  for (double stamp_s = 0; std::fread(&stamp_s, sizeof stamp_s, 1, file.get()) == 1;) stamps_s.push_back(stamp_s);
  return stamps_s;
}

void measure(const Options& options, const Rig& rig, pid_t arm, int from) {
  const auto transport = named_transport(options.transport, "lapservo_bench");
  const SteadyClock clock;
  SteadyClock loop_clock;
  InterlockConfig interlock;
  interlock.joints = default_joints();
  interlock.motion_enabled = true;
  TimedImages images(*transport, rig, options);
  CrtkRobot robot(*transport, "PSM1", interlock, loop_clock);
  for (const double end_s = clock.now_s() + 15; robot.counts().joint_states == 0;) {
    if (clock.now_s() > end_s) throw std::runtime_error("the arm is not heard");
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  RunConfig config;
  config.rig = rig;
  config.controller = controller_of(rig, options.ticks_per_s);
  config.tracking_thread = TrackingThread::own;
  config.arm_limits = config.controller.limits;
  Watcher watcher(*transport, images);
  run(robot, images, loop_clock, config, sinusoids(paper_sinusoids()), options.duration_s, watcher);
  std::ifstream load("/proc/loadavg");
  std::string load_1min;
  load >> load_1min;
  std::printf("%s, %s, %.0f s, %.0f ticks a second, load %s%s%s\n", options.transport.c_str(), options.images.c_str(),
              options.duration_s, options.ticks_per_s, load_1min.c_str(),
              images.counts().empty() ? "" : "; images: ", images.counts().c_str());
  report(watcher.seen(), stamps_of(arm, from));
}

}  // namespace
}  // namespace lapservo::internal

int main(int count, char** arguments) {
  using namespace lapservo::internal;
  if (count < 4) {
    std::fprintf(stderr, "usage: wire_bench ros2|ros1 raw|compressed SECONDS [TICKS_PER_SECOND]\n");
    return 2;
  }
  Options options{arguments[1], arguments[2], std::atof(arguments[3]), count > 4 ? std::atof(arguments[4]) : 120};
  const lapservo::Rig rig = lapservo::load_rig(LAPSERVO_BENCH_RIG);
  int ends[2];
  if (::pipe(ends) != 0) return 1;
  const pid_t arm = ::fork();
  if (arm == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::close(ends[0]);
    be_the_arm(options, rig, ends[1]);
    return 0;
  }
  ::close(ends[1]);
  try {
    measure(options, rig, arm, ends[0]);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wire_bench: %s\n", error.what());
    return 1;
  }
}
