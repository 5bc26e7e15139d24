#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "lapservo/crtk/transport.h"
#include "lapservo/robot/clock.h"

namespace lapservo::internal {

/// Time stands still but for what a test adds.
class StandingClock : public Clock {
 public:
  double now_s() const override { return now; }
  void sleep_until(double) override {}
  std::atomic<double> now = 10;
};

/// Topics in memory: messages that are published are kept; handlers get what say() says, in the caller's thread.
class TestTransport : public Transport {
 public:
  Publisher<JointMessage> set_point_publisher(const std::string& on) override { return publisher<JointMessage>(on); }
  Subscription subscribe_commands(const std::string& topic, CommandType, Handler<CommandMessage> handler) override {
    return add(topic, handler);
  }
  std::set<std::string> readers(const std::string&) const override { return readers_; }
  std::map<std::string, std::string> published() const override { return {}; }
  double stamp_now_s() const override { return stamp_s; }

  template <typename Message>
  void say(const std::string& topic, const Message& message) {
    for (const auto& weak : handlers<Message>()[topic])
      if (const auto handler = weak.lock()) (*handler)(Message(message));
  }
  /// All that was published.
  template <typename Message>
  std::vector<Message> sent(const std::string& topic) {
    const std::lock_guard lock(mutex_);
    return kept<Message>()[topic];
  }
  /// Says all that was published since the last call.
  void deliver() { deliver_all<JointMessage>(), deliver_all<OperatingStateMessage>(), deliver_all<ImageMessage>(); }

  /// Who reads, from now on.
  void let_read(std::set<std::string> readers) { readers_ = std::move(readers); }

  double stamp_s = 1000;

 private:
  template <typename Message>
  using Handlers = std::map<std::string, std::vector<std::weak_ptr<Handler<Message>>>>;
  template <typename Message>
  using Kept = std::map<std::string, std::vector<Message>>;

  template <typename Message>
  Handlers<Message>& handlers() {
    return std::get<Handlers<Message>>(handlers_);
  }
  template <typename Message>
  Kept<Message>& kept() {
    return std::get<Kept<Message>>(kept_);
  }
  void open(const std::string& topic, AnyPublisher& publisher) override {
    const auto make = [&]<typename Message>(Publisher<Message>& one) {
      one = [this, topic](const Message& message) {
        const std::lock_guard lock(mutex_);
        kept<Message>()[topic].push_back(message);
      };
    };
    std::visit(make, publisher);
  }
  Subscription listen(const std::string& topic, const AnyHandler& handler) override {
    return std::visit([&](const auto& one) { return add(topic, one); }, handler);
  }
  template <typename Message>
  Subscription add(const std::string& topic, const std::function<void(Message&&)>& handler) {
    auto shared = std::make_shared<Handler<Message>>(handler);
    handlers<Message>()[topic].push_back(shared);
    return shared;
  }
  template <typename Message>
  void deliver_all() {
    for (auto& [topic, messages] : std::exchange(kept<Message>(), {}))
      for (const auto& message : messages) say(topic, message);
  }

  std::mutex mutex_;
  std::set<std::string> readers_{"/arm"};
  std::tuple<Kept<JointMessage>, Kept<OperatingStateMessage>, Kept<StringMessage>, Kept<TextMessage>, Kept<JoyMessage>,
             Kept<BoolMessage>, Kept<TrajectoryMessage>, Kept<ImageMessage>, Kept<CompressedImageMessage>,
             Kept<CameraInfoMessage>, Kept<PoseMessage>, Kept<PlaceMessage>, Kept<TransformsMessage>,
             Kept<StaticTransformsMessage>, Kept<CylindersMessage>, Kept<DiagnosticMessage>, Kept<ObservationMessage>>
      kept_;
  std::tuple<Handlers<JointMessage>, Handlers<OperatingStateMessage>, Handlers<StringMessage>, Handlers<TextMessage>,
             Handlers<BoolMessage>, Handlers<CommandMessage>, Handlers<TrajectoryMessage>, Handlers<ImageMessage>,
             Handlers<CompressedImageMessage>, Handlers<PlaceMessage>>
      handlers_;
};

}  // namespace lapservo::internal
