#pragma once

#include <functional>

namespace lapservo::internal {

/// Thrown when the user stops the run.
struct Interrupted {};

/// Receives the progress of a job; returns false to stop it.
using KeepGoing = std::function<bool(int done, int total)>;

/// Calls work(index) once for each index in [0, count), on all cores but at most eight. make_worker is called once on
/// each thread and gives its `work`, which may hold state of its own; results must not depend on which worker does
/// which index. `keep_going` is called after each, one at a time; when it says no, throws Interrupted. An exception of
/// a worker ends the job and is passed on.
void in_parallel(int count, const std::function<std::function<void(int index)>()>& make_worker,
                 const KeepGoing& keep_going);

}  // namespace lapservo::internal
