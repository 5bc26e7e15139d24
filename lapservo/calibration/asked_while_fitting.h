#pragma once

#include <functional>

namespace lapservo::internal {

/// While it lives, every fit of this thread calls `is_stopped` at each of its iterations. What that throws ends the fit
/// and comes out of it. What it answers doesn't: what a live camera showed until it was stopped is to be fitted.
class AskedWhileFitting {
 public:
  explicit AskedWhileFitting(std::function<bool()> is_stopped);
  ~AskedWhileFitting();
  AskedWhileFitting(const AskedWhileFitting&) = delete;
  AskedWhileFitting& operator=(const AskedWhileFitting&) = delete;

  /// Calls that of the innermost one of this thread, if there is one.
  static void ask();

 private:
  std::function<bool()> is_stopped_;
  const AskedWhileFitting* outer_;
};

}  // namespace lapservo::internal
