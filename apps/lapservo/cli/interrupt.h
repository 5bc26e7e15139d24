#pragma once

#include <functional>

namespace lapservo::app {

/// From now on Ctrl-C, SIGTERM and SIGHUP (a terminal that is closed) let the running job end well; a second one ends
/// it at once.
void watch_for_interrupts();
bool interrupted();

/// Whether `holds` comes true before Ctrl-C and within this time; looks a hundred times a second.
bool wait_until(const std::function<bool()>& holds, double at_most_s);

}  // namespace lapservo::app
