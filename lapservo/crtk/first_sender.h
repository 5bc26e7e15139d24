#pragma once

#include <cstdint>
#include <optional>

namespace lapservo::internal {

/// Whose messages of a topic count: those of the first sender, until it has been silent for 0.5 s; then those of the
/// next one.
class FirstSender {
 public:
  static constexpr double silence_s = 0.5;

  enum class Verdict { counts, counts_anew, other };
  /// `counts_anew`: of one that comes after another.
  Verdict hear(std::uint64_t source, double arrival_s) {
    const bool another = source_.value_or(source) != source;
    if (another && arrival_s - heard_s_ <= silence_s) {
      other_s_ = arrival_s;
      return Verdict::other;
    }
    if (another) other_s_ = never_s;
    source_ = source, heard_s_ = arrival_s;
    return another ? Verdict::counts_anew : Verdict::counts;
  }
  /// Another topic's message of this source came.
  void is_there(std::uint64_t source, double arrival_s) {
    if (source_ == source) heard_s_ = arrival_s;
  }
  /// Whether a message of another one came within the last 0.5 s.
  bool has_rival(double time_s) const { return time_s - other_s_ <= silence_s; }

 private:
  static constexpr double never_s = -1e9;
  std::optional<std::uint64_t> source_;
  double heard_s_ = never_s, other_s_ = never_s;
};

}  // namespace lapservo::internal
