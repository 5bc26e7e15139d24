#include "lapservo/experiments/setup.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>

#include "lapservo/rig/instruments.h"

namespace lapservo::internal {

Rig without_registration(Rig rig) {
  for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
  return rig;
}

Rig known_exactly(Rig rig) {
  rig = without_sigmas(std::move(rig));
  for (Instrument& instrument : rig.instruments) instrument.marker.tolerance_m = 0;
  return rig;
}

std::string method_title(Method method) {
  return method == Method::centerline ? "the paper\u2019s method" : "the default";
}

int method_colour(Method method) {
  return method == Method::centerline ? 1 : 0;
}

void in_parallel(int count, const std::function<std::function<void(int index)>()>& make_worker,
                 const KeepGoing& keep_going) {
  std::atomic<int> next = 0;
  std::atomic<bool> stop = false;
  std::mutex mutex;
  int done = 0;
  std::exception_ptr failure;
  const auto fail = [&](std::exception_ptr what) {
    const std::lock_guard lock(mutex);
    if (!failure) failure = std::move(what);
    stop = true;
  };
  const auto run = [&] {
    try {
      const auto work = make_worker();
      for (int index = next++; index < count && !stop; index = next++) {
        work(index);
        const std::lock_guard lock(mutex);
        if (!keep_going(++done, count)) throw Interrupted{};
      }
    } catch (...) {
      fail(std::current_exception());
    }
  };
  const int cores = static_cast<int>(std::thread::hardware_concurrency());
  std::vector<std::jthread> threads;
  for (int i = 0; i < std::min(count, std::clamp(cores, 1, 8)); ++i) threads.emplace_back(run);
  threads.clear();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace lapservo::internal
