#include "python/src/running.h"

#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>
#include <utility>

#include "lapservo/core/error.h"
#include "python/src/conversions.h"

namespace lapservo::python {
namespace {

std::atomic<int> signalled = 0;
static_assert(std::atomic<int>::is_always_lock_free, "written by a handler of signals");
bool process_ends = false, ends_runs = false;
std::set<const void*> ports_of_runs;

void on_signal(int number) {
  signalled = number;
  std::signal(number, SIG_DFL);
}

// Handlers of Python's own, and signals that are ignored (nohup), stay.
void replace_handlers(void (*from)(int), void (*to)(int)) {
  for (const int number : {SIGTERM, SIGHUP}) {
    struct sigaction now {};
    if (sigaction(number, nullptr, &now) == 0 && now.sa_handler == from) std::signal(number, to);
  }
}

// Afterwards Python ends threads wherever they are.
void end_runs() {
  process_ends = true;
  while (!ports_of_runs.empty() && !is_interrupted())
    unlocked([] { std::this_thread::sleep_for(std::chrono::milliseconds(10)); });
  process_ends = false;
}

}  // namespace

Running::Running(const Robot& robot, const ImageStream& images)
    : ports_{dynamic_cast<const void*>(&robot), dynamic_cast<const void*>(&images)} {
  const py::module_ threading = py::module_::import("threading");
  const py::object main_thread = threading.attr("main_thread")(), its_ident = main_thread.attr("ident");
  main_thread_ = its_ident.equal(threading.attr("get_ident")()) ? py::none() : main_thread;
  if (is_to_end()) throw InputError("run", "the process ends: no run() begins any more");
  if (!std::exchange(ends_runs, true)) py::module_::import("atexit").attr("register")(py::cpp_function(end_runs));
  // From here on no other thread has Python's lock.
  for (const void* port : ports_)
    if (ports_of_runs.contains(port))
      throw InputError("run", port == dynamic_cast<const void*>(&robot) ? "robot" : "images", "in another run()",
                       "one that no other run() has: end that one first");
  if (ports_of_runs.empty()) replace_handlers(SIG_DFL, on_signal);
  ports_of_runs.insert(ports_.begin(), ports_.end());
}

Running::~Running() {
  for (const void* port : ports_) ports_of_runs.erase(port);
  if (!ports_of_runs.empty()) return;
  replace_handlers(on_signal, SIG_DFL);
  if (const int number = signalled.exchange(0)) std::raise(number);
}

bool Running::is_to_end() const {
  return signalled != 0 || process_ends || !(main_thread_.is_none() || main_thread_.attr("is_alive")().cast<bool>());
}

}  // namespace lapservo::python
