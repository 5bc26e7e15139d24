#pragma once

#include <cstddef>
#include <deque>
#include <utility>
#include <vector>

#include "lapservo/robot/robot.h"

namespace lapservo {

/// For an arm that is read more often than a control tick comes: its readings until Robot::readings() takes them, the
/// newest 1000 where nobody does. One thread at a time.
class ReadingBuffer {
 public:
  void add(const JointReading& reading) {
    if (readings_.size() == max_readings) readings_.pop_front();
    readings_.push_back(reading);
  }
  std::vector<JointReading> all() const { return {readings_.begin(), readings_.end()}; }
  std::vector<JointReading> take() {
    const std::deque<JointReading> taken = std::exchange(readings_, {});
    return {taken.begin(), taken.end()};
  }

 private:
  static constexpr std::size_t max_readings = 1000;
  std::deque<JointReading> readings_;
};

}  // namespace lapservo
