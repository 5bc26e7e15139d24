#include "recordings/bag_recorder.h"

#include <cstdint>
#include <limits>
#include <utility>

#include "lapservo/core/wall_clock.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t max_waiting_bytes = std::size_t{512} << 20;

std::size_t bytes_of(const BagRecorder::Message& message) {
  const auto bytes = [](const auto& one) {
    if constexpr (requires { one.data; }) return one.data.size();
    if constexpr (requires { one.names; }) return 64 * one.names.size();
  };
  return std::visit(bytes, message);
}

}  // namespace

BagRecorder::BagRecorder(const std::filesystem::path& folder, double most_fps)
    : most_fps_(most_fps), writer_(folder), thread_([this] { write_all(); }) {}

BagRecorder::~BagRecorder() {
  end();
}

bool BagRecorder::is_of_first_sender(const std::string& topic, std::uint64_t source) {
  using Verdict = FirstSender::Verdict;
  const Verdict verdict = senders_[topic].hear(source, clock_.now_s());
  if (verdict != Verdict::counts) counts_.of_second_senders[topic] += verdict == Verdict::other;
  return verdict != Verdict::other;
}

// A stream that is a little faster is kept whole.
bool BagRecorder::is_too_soon(double stamp_s) {
  if (stamp_s < next_image_s_ && stamp_s > next_image_s_ - 2 / most_fps_) return true;
  next_image_s_ = stamp_s + 0.75 / most_fps_;
  return false;
}

void BagRecorder::add(const std::string& topic, Message message) {
  const std::size_t bytes = bytes_of(message);
  const auto [stamp_s, source] = std::visit([](const auto& m) { return std::pair(m.stamp_s, m.source); }, message);
  const std::lock_guard lock(mutex_);
  if (!is_of_first_sender(topic, source)) return;
  if (!(stamp_s > 0 && stamp_s < std::numeric_limits<std::int32_t>::max())) {
    ++counts_.unstamped;
    return;
  }
  const bool is_image = !std::holds_alternative<JointMessage>(message);
  if (is_image && is_too_soon(stamp_s)) return;
  counts_.arrived += is_image;
  if (is_image && waiting_bytes_ + bytes > max_waiting_bytes) {
    ++counts_.dropped;
    return;
  }
  waiting_bytes_ += bytes;
  waiting_.push({topic, since_1970_s(), std::move(message)});
}

void BagRecorder::write(const Entry& entry) {
  std::visit([&](const auto& message) { writer_.write(entry.topic, entry.time_s, message); }, entry.message);
  const std::lock_guard lock(mutex_);
  waiting_bytes_ -= bytes_of(entry.message);
  ++(std::holds_alternative<JointMessage>(entry.message) ? counts_.joints : counts_.images);
}

void BagRecorder::write_all() {
  try {
    while (const auto entry = waiting_.pop()) write(*entry);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
}

RecordedCounts BagRecorder::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

void BagRecorder::check() const {
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(failure_);
}

void BagRecorder::end() {
  waiting_.close();
  if (thread_.joinable()) thread_.join();
}

void BagRecorder::finish() {
  end();
  check();
  writer_.finish();
}

}  // namespace lapservo::internal
