#pragma once

#include <string>

namespace lapservo::internal {

/// Requests SCHED_FIFO with this priority (1 to 99) for the calling thread, not for those that it starts, and for
/// locked memory, so that computing or swapping of other programs delays it less. Empty, or what the system did not
/// grant: "real-time priority and locked memory"; the thread runs without it.
std::string request_real_time(int priority);

}  // namespace lapservo::internal
