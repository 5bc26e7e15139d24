#include "lapservo/calibration/recording/joint_recording.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {
namespace {

constexpr double longest_pause_s = 0.5;

// Slope of one joint at a row: of the parabola through it and its neighbours, one-sided at ends and pauses.
double slope_at(const JointRecording& r, std::size_t row, std::size_t joint) {
  const auto chord = [&](std::size_t from) {
    return (r.joints[from + 1][joint] - r.joints[from][joint]) / (r.time_s[from + 1] - r.time_s[from]);
  };
  const bool before = row > 0 && r.time_s[row] - r.time_s[row - 1] <= longest_pause_s;
  const bool after = row + 1 < r.time_s.size() && r.time_s[row + 1] - r.time_s[row] <= longest_pause_s;
  if (before && after) {
    const double left_s = r.time_s[row] - r.time_s[row - 1], right_s = r.time_s[row + 1] - r.time_s[row];
    return (right_s * chord(row - 1) + left_s * chord(row)) / (left_s + right_s);
  }
  return before ? chord(row - 1) : after ? chord(row) : 0;
}

}  // namespace

std::optional<std::array<double, 4>> JointRecording::at(double at_s) const {
  const auto next = std::lower_bound(time_s.begin(), time_s.end(), at_s);
  if (next == time_s.end() || (next == time_s.begin() && *next > at_s)) return std::nullopt;
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(1, next - time_s.begin()));
  const double from_s = time_s[i - 1], to_s = time_s[i];
  if (to_s - from_s > longest_pause_s) return std::nullopt;
  std::array<double, 4> result;
  const double part = (at_s - from_s) / (to_s - from_s);
  for (std::size_t j = 0; j < 4; ++j) result[j] = (1 - part) * joints[i - 1][j] + part * joints[i][j];
  return result;
}

std::string JointRecording::remark() const {
  std::vector<std::string> parts;
  const auto add = [&](int count, const char* what) {
    if (count > 0) parts.push_back(fmt::format("{} {}", count, what));
  };
  add(repeated, "repeated readings"), add(of_other_arms, "readings of other arms' joints");
  add(left_out, "readings without a stamp that goes with the others'"), add(no_numbers, "readings that are no numbers");
  std::string text = parts.empty() ? "" : fmt::format("passed over: {}", fmt::join(parts, ", "));
  if (steps == 0) return text;
  return fmt::format("{}{}{}", text, text.empty() ? "" : "; ", clock_set_text("the joints", steps, steps_by_gap));
}

std::string clock_set_text(const std::string& whose, int steps, int steps_by_gap) {
  const std::string by_gap =
      steps_by_gap == 0 ? ""
                        : fmt::format(", {} times by the usual gap: the recorder's shows no later time", steps_by_gap);
  return fmt::format("the clock of {} was set {} times: times go on by the recorder's{}", whose, steps, by_gap);
}

JointRecording read_joint_recording(const std::filesystem::path& path, const Joints& joints, JointsOf whose) {
  return joint_recording_of(CsvTable::read(path), path.string(), joints, whose);
}

JointRecording joint_recording_of(const CsvTable& table, const std::string& source, const Joints& joints,
                                  JointsOf whose) {
  JointRecording recording;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const double time_s = table.number(row, "time_s");
    std::array<double, 4> at;
    for (std::size_t i = 0; i < at.size(); ++i) at[i] = table.number(row, joints.names[i]);
    if (!recording.time_s.empty() && time_s == recording.time_s.back() && at == recording.joints.back()) {
      ++recording.repeated;
      continue;
    }
    if (!recording.time_s.empty() && !(time_s > recording.time_s.back()))
      throw InputError(source, "row " + std::to_string(row + 1) + ": time_s", table.text(row, "time_s"),
                       "later than the row before: the clock jumps");
    recording.time_s.push_back(time_s), recording.joints.push_back(at);
  }
  if (recording.time_s.size() < 2) throw InputError(source, "has fewer than two rows");
  check_units(recording, joints, source, whose);
  return recording;
}

void check_units(const JointRecording& recording, const Joints& joints, const std::string& source, JointsOf whose) {
  constexpr double turn_rad = 2 * std::numbers::pi, largest_m = 2;
  constexpr std::array<double, 4> largest_rad{2 * turn_rad, 2 * turn_rad, 16 * turn_rad, 16 * turn_rad};
  for (std::size_t i = 0; i < joints.names.size(); ++i) {
    const bool is_length = whose == JointsOf::arm && i == 2;
    for (const auto& at : recording.joints)
      if (std::abs(at[i]) > (is_length ? largest_m : whose == JointsOf::wrist ? turn_rad : largest_rad[i]))
        throw InputError(source, joints.names[i], fmt::format("{:.6g}", at[i]),
                         is_length ? "metres: it looks like millimetres" : "radians: it looks like degrees");
  }
}

Joints joints_of(const Instrument& instrument, const std::vector<std::string>& recorded, const std::string& source,
                 const std::string& rig) {
  if (instrument.joints) return *instrument.joints;
  Joints joints;
  if (recorded.size() != joints.names.size())
    throw InputError(source, "joints", fmt::format("{}", fmt::join(recorded, ", ")),
                     "four (theta's, phi's, rho's, psi's), since " + instrument.name + " has no joints entry in " +
                         rig + " that would name them among others");
  std::copy(recorded.begin(), recorded.end(), joints.names.begin());
  return joints;
}

JointRecording refined(const JointRecording& r, double step_s) {
  JointRecording fine;
  for (std::size_t i = 0; i + 1 < r.time_s.size(); ++i) {
    fine.time_s.push_back(r.time_s[i]), fine.joints.push_back(r.joints[i]);
    const double span_s = r.time_s[i + 1] - r.time_s[i];
    if (span_s > longest_pause_s) continue;
    const int parts = static_cast<int>(std::ceil(span_s / step_s));
    for (int k = 1; k < parts; ++k) {
      const double t = static_cast<double>(k) / parts, t2 = t * t, t3 = t2 * t;
      fine.time_s.push_back(r.time_s[i] + t * span_s);
      auto& at = fine.joints.emplace_back();
      for (std::size_t j = 0; j < 4; ++j)
        at[j] = (2 * t3 - 3 * t2 + 1) * r.joints[i][j] + (t3 - 2 * t2 + t) * span_s * slope_at(r, i, j) +
                (3 * t2 - 2 * t3) * r.joints[i + 1][j] + (t3 - t2) * span_s * slope_at(r, i + 1, j);
    }
  }
  fine.time_s.push_back(r.time_s.back()), fine.joints.push_back(r.joints.back());
  return fine;
}

void put_behind_gap(JointRecording& recording, std::size_t joint, double width) {
  const double size = std::abs(width);
  Backlash gap(recording.joints.front()[joint]);
  for (auto& joints : recording.joints) {
    gap.follow(joints[joint], size);
    const double behind = gap.instrument(size) - joints[joint];
    joints[joint] += width < 0 ? -behind : behind;
  }
}

}  // namespace lapservo::internal
