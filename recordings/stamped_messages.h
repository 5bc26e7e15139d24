#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "recordings/bag.h"

namespace lapservo::internal {

struct StampedMessage {
  double time_s = 0;      ///< by its header's stamp, on the clock as it was at the first message
  double recorded_s = 0;  ///< by the recorder's clock
  BagMessage message;
};

/// The messages of a topic whose stamps rise, as seen a few messages ahead. Left out and counted are messages without a
/// stamp, those whose stamp is not later than the one before, and those whose stamp stands out from those before and
/// behind it, compared with the recorder's times. Where the stamps go on from another time, because a clock was set,
/// times go on by the recorder's; where that shows no later time, set back too, by the usual time from message to
/// message. A stamp that is repeated, however often, is no clock that was set.
class StampedMessages {
 public:
  /// `wanted`: which of the messages count at all; empty: all.
  explicit StampedMessages(std::unique_ptr<BagMessages> messages,
                           std::function<bool(const BagMessage&)> wanted = nullptr);

  /// nullopt at the end.
  std::optional<StampedMessage> next();
  int left_out() const { return left_out_; }
  /// Those of them with the same stamp as the one before.
  int repeated() const { return repeated_; }
  /// Why the first was left out.
  const std::string& why() const { return why_; }
  /// How often the clock was set.
  int steps() const { return steps_; }
  /// How often of these the recorder's showed no later time.
  int steps_by_gap() const { return steps_by_gap_; }

 private:
  struct Seen {
    double stamp_s = 0, recorded_s = 0;
    double lead_s() const { return stamp_s - recorded_s; }
  };
  struct Ahead {
    Seen seen;
    BagMessage message;
  };
  struct Around {
    double lead_s = 0, tolerance_s = 0;
  };
  void look_ahead();
  Around around(const Seen& seen) const;
  double usual_gap_s(const Seen& seen) const;
  bool goes_back(const Seen& seen) const;
  void leave_out(const std::string& why);
  void leave_out_repeated();

  std::unique_ptr<BagMessages> messages_;
  std::function<bool(const BagMessage&)> wanted_;
  std::deque<Ahead> ahead_;
  std::deque<Seen> behind_;
  std::optional<double> last_s_, last_lead_s_;
  double last_stamp_s_ = 0, last_read_s_ = 0;  // of what was given, and of what was read ahead
  double shift_s_ = 0;                         // of the stamps to the clock at the first message
  int left_out_ = 0, repeated_ = 0, steps_ = 0, steps_by_gap_ = 0;
  std::string why_;
  bool ended_ = false;
};

}  // namespace lapservo::internal
