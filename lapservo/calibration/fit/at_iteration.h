#pragma once

#include <functional>

namespace lapservo::internal {

/// Called at each iteration of a fit; what it throws ends the fit and comes out of it. May be empty.
using AtIteration = std::function<void()>;

}  // namespace lapservo::internal
