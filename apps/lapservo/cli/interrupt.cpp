#include "apps/lapservo/cli/interrupt.h"

#include <csignal>

namespace lapservo::app {
namespace {

volatile std::sig_atomic_t asked_to_stop = 0;

void on_signal(int number) {
  asked_to_stop = 1;
  std::signal(number, SIG_DFL);
}

}  // namespace

void watch_for_interrupts() {
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
}

bool interrupted() {
  return asked_to_stop != 0;
}

}  // namespace lapservo::app
