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

BagRecorder::BagRecorder(const std::filesystem::path& folder) : writer_(folder), thread_([this] { write_all(); }) {}

BagRecorder::~BagRecorder() {
  end();
}

void BagRecorder::add(const std::string& topic, Message message) {
  const std::size_t bytes = bytes_of(message);
  const double stamp_s = std::visit([](const auto& m) { return m.stamp_s; }, message);
  const std::lock_guard lock(mutex_);
  if (!(stamp_s > 0 && stamp_s < std::numeric_limits<std::int32_t>::max())) {
    ++counts_.unstamped;
    return;
  }
  const bool is_image = !std::holds_alternative<JointMessage>(message);
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
