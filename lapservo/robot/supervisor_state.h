#pragma once

#include <compare>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <vector>

#include "lapservo/robot/blocked.h"

namespace lapservo {

/// Who says stop and start.
struct Commander {
  enum Kind { program, page, topic };
  Kind kind = program;
  std::uint64_t source = 0;  ///< of a topic's: which program sent it

  constexpr Commander(Kind of, std::uint64_t from = 0) : kind(of), source(from) {}
  auto operator<=>(const Commander&) const = default;
};
using Commanders = std::set<Commander>;

struct SupervisorConfig {
  double settle_s = 0.5;           ///< an arm has to be ready for so long, without a gap, before a start moves it
  double start_lasts_s = 1;        ///< a start that was said longer ago is void
  double connect_s = 15;           ///< the first start waits so long for the arm, and the loop for its first image
  double max_loop_hold_s = 2;      ///< a longer hold of the loop needs a start
  double max_silence_s = 0.5;      ///< a longer silence of the arm, or of the loop, needs a start
  double max_reading_age_s = 0.1;  ///< of joint states
};

/// All that happened since the step before.
struct SupervisorInput {
  struct Start {
    Commander who = Commander::program;
    double said_s = 0;
    bool force = false;  ///< whoever holds
  };
  double time_s = 0;
  Blocked arm = Blocked::none;         ///< the first thing for which the arm was not ready, however short it was
  bool follows = true;                 ///< JointState::follows
  bool at_rest = true;                 ///< the last path sent has ended
  bool operator_present = true;        ///< throughout
  bool loop_holds = false;             ///< by the loop's latest decision
  Blocked loop_event = Blocked::none;  ///< for which the loop needs a start at once
  bool suspended = false;              ///< the computer was, since the step before
  bool ended = false;
  Commanders stops;
  std::vector<Start> starts;
};

/// Whether an arm may be moved. An arm is ready while it is ENABLED, homed, not busy, at its own setpoint, commanded by
/// nobody else, alone in reading its setpoints, and its joint states are finite and new.
///
/// | state      | event                                                                          | next state |
/// | ---------- | ------------------------------------------------------------------------------ | ---------- |
/// | connecting | the arm has been ready for settle_s and is at rest, the operator is present    | armed      |
/// | connecting | a stop; the arm says that it is not ready; connect_s have passed               | held       |
/// | held       | a start that counts                                                            | arming     |
/// | arming     | the arm has been ready for settle_s and is at rest                             | armed      |
/// | arming     | a stop; the arm was not ready; the operator was absent                         | held       |
/// | armed      | the arm is silent                                                              | silent     |
/// | silent     | the arm is ready again and at rest                                             | armed      |
/// | silent     | it lasts more than max_silence_s since the arm was ready last                  | held       |
/// | armed      | the loop's event; the loop holds for more than max_loop_hold_s                 | held       |
/// | all three  | more than max_silence_s since the step before; the computer was suspended      | held       |
/// | both       | a stop; the arm was not ready for another reason; the operator was absent      | held       |
/// | any        | the end of the run                                                             | held       |
///
/// The arm moves while armed only. A start counts if it was said at most start_lasts_s ago and not before the hold,
/// nobody said stop since the step before, everybody who said stop has said start since (or this start has force), the
/// arm is ready and the operator present; otherwise it is void. An arm that does not follow needs no start: nothing
/// moves it.
struct SupervisorState {
  enum class Phase { connecting, held, arming, armed, silent };
  Phase phase = Phase::connecting;
  Blocked obstacle = Blocked::none;  ///< now
  Blocked reason = Blocked::none;    ///< the latest obstacle: why it is held
  Commanders held_by;
  bool started = false;  ///< a start counted in this step
  bool tracked = false;  ///< the loop has had an image
  double time_s = -std::numeric_limits<double>::infinity();
  double held_since_s = -std::numeric_limits<double>::infinity();  ///< the latest thing that holds
  double ready_s = -std::numeric_limits<double>::infinity();       ///< when the arm was ready last
  std::optional<double> begun_s, ready_since_s, loop_holds_since_s;
};

SupervisorState next(SupervisorState state, const SupervisorInput& input, const SupervisorConfig& config);

}  // namespace lapservo
