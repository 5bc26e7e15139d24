#include "lapservo/robot/real_time.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

namespace lapservo::internal {

// Where lockable memory has a limit, later allocations would fail: then nothing is locked.
std::string request_real_time(int priority) {
  const sched_param parameters{.sched_priority = priority};
  const bool first = ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0;
  rlimit limit{};
  const bool unlimited = ::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY;
  const bool locked = unlimited && ::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0;
  if (first && locked) return {};
  return std::string(first ? "" : "real-time priority") + (first || locked ? "" : " and ") +
         (locked ? "" : "locked memory");
}

}  // namespace lapservo::internal
