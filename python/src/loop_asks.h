#pragma once

namespace lapservo::python {

/// Whether this thread's call is the loop's, passed on by a robot in Python; else it is an onlooker's.
inline thread_local bool loop_asks = false;

}  // namespace lapservo::python
