#include "apps/lapservo/cli/interrupt.h"

#include <chrono>
#include <csignal>
#include <thread>

namespace lapservo::app {
namespace {

volatile std::sig_atomic_t asked_to_stop = 0;

void on_signal(int number) {
  asked_to_stop = 1;
  std::signal(number, SIG_DFL);
}

}  // namespace

void watch_for_interrupts() {
  for (const int number : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(number, on_signal) == SIG_IGN && number == SIGHUP) std::signal(SIGHUP, SIG_IGN);  // nohup
}

bool interrupted() {
  return asked_to_stop != 0;
}

bool wait_until(const std::function<bool()>& holds, double at_most_s) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(at_most_s);
  while (!holds()) {
    if (interrupted() || std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

}  // namespace lapservo::app
