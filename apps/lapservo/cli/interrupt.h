#pragma once

namespace lapservo::app {

/// From now on Ctrl-C (and SIGTERM) lets the running job end well; a second one ends it at once.
void watch_for_interrupts();
bool interrupted();

}  // namespace lapservo::app
