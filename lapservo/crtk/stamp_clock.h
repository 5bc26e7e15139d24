#pragma once

#include <optional>

namespace lapservo::internal {

/// Verdict on the stamp of a message.
enum class StampVerdict {
  fresh,
  repeated,  ///< not newer than the one before: the same message again, an old one, or out of order
  late,      ///< it was on its way for much longer than others
  jumped,    ///< the sender's clock was set, forwards or back; the next message counts again
  unusable,  ///< no stamp: zero or not finite
};

/// Puts a sender's stamps on the loop's clock without asking that both computers agree on the time: the smallest
/// difference between arrival and stamp is taken for that of the clocks. So a time is as if the message had travelled
/// as fast as the fastest one. The difference may drift by 1 ms a second. A clock that is set costs two messages; where
/// that looks like a way that has become longer, and stays as long, a second.
class StampClock {
 public:
  /// `late_s`: so much longer on its way than the fastest is late.
  explicit StampClock(double late_s) : late_s_(late_s) {}

  struct Reading {
    StampVerdict verdict = StampVerdict::unusable;
    double time_s = 0;  ///< fresh: the stamp on the loop's clock, at most the arrival, never backwards
  };
  /// `arrival_s`: on the loop's clock.
  Reading read(double stamp_s, double arrival_s);

 private:
  struct Stamped {
    double stamp_s = 0, arrival_s = 0;
  };
  void start_anew(const Stamped& message);
  bool was_set_back(const Stamped& message);
  bool stays_late(const Stamped& message);

  double late_s_;
  std::optional<Stamped> last_, older_;  // older_: the message before, when its stamp lay behind that of last_
  struct Late {
    double since_s = 0, least_s = 0, most_s = 0;  ///< arrival minus stamp
  };
  std::optional<Late> late_;
  double offset_s_ = 0, last_time_s_ = 0;
};

}  // namespace lapservo::internal
