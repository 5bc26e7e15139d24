#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/report/html_report.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/tracker.h"

namespace lapservo::internal {

/// Thrown when the user stops the run.
struct Interrupted {};

/// Receives the progress of a job; returns false to stop it.
using KeepGoing = std::function<bool(int done, int total)>;

/// Input of every experiment.
struct ExperimentSetup {
  Rig rig;  ///< one instrument, with camera_from_rcm: see single_instrument()
  std::uint64_t seed = 1;
  std::vector<Method> methods{Method::centerline, Method::surface};
  KeepGoing keep_going = [](int, int) { return true; };
  std::string options;  ///< of the command line, for "how to make it again": begins with a space when not empty
};

/// The rig of configs/paper.yaml, on which the paper's trajectory is feasible.
Rig paper_rig();

/// For trackers that must not know where the RCM is.
Rig without_registration(Rig rig);
/// Without its `sigma_` keys, covariances and the print's tolerance: for trackers of images of the rig itself, which it
/// describes exactly.
Rig known_exactly(Rig rig);

/// "the paper's method" or "the default".
std::string method_title(Method method);
/// The colour of a method's series in every plot.
int method_colour(Method method);

/// Makes rows of the report of the results of each method (anything with a `method`), said by `text_of`.
template <class Results>
auto comparing(const Results& results) {
  return [&results](std::string what, std::string paper, const auto& text_of) {
    Comparison row{std::move(what), std::move(paper), "", ""};
    for (const auto& result : results)
      (result.method == Method::centerline ? row.centerline : row.surface) = text_of(result);
    return row;
  };
}

/// Calls work(index) once for each index in [0, count), on all cores but at most eight. make_worker is called once on
/// each thread and gives its `work`, which may hold state of its own; results must not depend on which worker does
/// which index. `keep_going` is called after each, one at a time; when it says no, throws Interrupted. An exception of
/// a worker ends the job and is passed on.
void in_parallel(int count, const std::function<std::function<void(int index)>()>& make_worker,
                 const KeepGoing& keep_going);

}  // namespace lapservo::internal
