// Another process of ros1_transport_test, a node of the name that is its argument or "peer": what comes on /in/X goes
// out on /out/X. A string may ask for more.

#include <chrono>
#include <cstring>
#include <ros/ros.h>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

#include "transports/ros1/ros1_messages.h"
#include "transports/ros1/ros1_subscription.h"
#include "transports/ros1/ros1_transport.h"

namespace {

// Says that it is a JointState, and is what its bytes are.
struct Pretender : lapservo::internal::Ros1Type<lapservo::internal::JointMessage> {
  std::vector<std::uint8_t> bytes;
};

// 1000 messages at 30,000 a second.
void flood(const lapservo::internal::Transport::Publisher<lapservo::internal::StringMessage>& say) {
  for (int k = 0; k < 1000; ++k) {
    if (k % 10 == 0) std::this_thread::sleep_for(std::chrono::microseconds(333));
    say({0, "flood"});
  }
}

}  // namespace

namespace ros {
namespace message_traits {

template <>
struct MD5Sum<Pretender> : MD5Sum<lapservo::internal::Ros1Type<lapservo::internal::JointMessage>> {};
template <>
struct DataType<Pretender> : DataType<lapservo::internal::Ros1Type<lapservo::internal::JointMessage>> {};
template <>
struct Definition<Pretender> : Definition<lapservo::internal::Ros1Type<lapservo::internal::JointMessage>> {};

}  // namespace message_traits

namespace serialization {

template <>
struct Serializer<Pretender> {
  template <typename Stream>
  static void write(Stream& stream, const Pretender& message) {
    if (!message.bytes.empty())
      std::memcpy(stream.advance(serializedLength(message)), message.bytes.data(), message.bytes.size());
  }
  static std::uint32_t serializedLength(const Pretender& message) {
    return static_cast<std::uint32_t>(message.bytes.size());
  }
};

}  // namespace serialization
}  // namespace ros

int main(int argc, char** argv) {
  using namespace lapservo::internal;
  const std::string name = argc > 1 ? argv[1] : "peer";
  Ros1Transport transport(name);
  std::vector<Transport::Subscription> subscriptions;
  const auto echo = [&](const std::string& kind, auto publisher, auto subscribe) {
    const auto say = (transport.*publisher)("/out/" + kind);
    subscriptions.push_back((transport.*subscribe)("/in/" + kind, [say](auto&& message) { say(message); }));
  };
  echo("joints", &Transport::publisher<JointMessage>, &Transport::subscribe<JointMessage>);
  echo("words", &Transport::publisher<TextMessage>, &Transport::subscribe<TextMessage>);
  echo("bool", &Transport::publisher<BoolMessage>, &Transport::subscribe<BoolMessage>);
  echo("trajectory", &Transport::publisher<TrajectoryMessage>, &Transport::subscribe<TrajectoryMessage>);
  echo("image", &Transport::publisher<ImageMessage>, &Transport::subscribe<ImageMessage>);
  echo("compressed", &Transport::publisher<CompressedImageMessage>, &Transport::subscribe<CompressedImageMessage>);
  echo("place", &Transport::publisher<PlaceMessage>, &Transport::subscribe<PlaceMessage>);
  const auto state = transport.publisher<OperatingStateMessage>("/out/state");
  state({1700000000, "DISABLED", false, false});  // before anybody listens: it is latched
  subscriptions.push_back(
      transport.subscribe<OperatingStateMessage>("/in/state", [&](OperatingStateMessage&& m) { state(m); }));
  const auto joy = transport.publisher<JoyMessage>("/out/joy");
  subscriptions.push_back(transport.subscribe<BoolMessage>("/in/joy", [&](BoolMessage&& m) { joy({0, {m.value}}); }));
  const auto odd = transport.publisher<ImageMessage>("/out/odd");
  ros::Publisher pretender = ros::NodeHandle().advertise<Pretender>("/out/pretender", 10);
  const auto kept = ros::NodeHandle().advertise<Ros1Type<StringMessage>>("/out/kept", 1, true);
  kept.publish(ros1_message(StringMessage{0, "start"}));
  const auto text = transport.publisher<StringMessage>("/out/text");
  subscriptions.push_back(transport.subscribe<StringMessage>("/in/text", [&](StringMessage&& m) {
    if (m.text == "pretend") {
      Pretender pretended;
      pretended.bytes.assign(40, 0xff);
      pretender.publish(pretended);
      pretender.publish(Pretender());
    }
    if (m.text == "flood" && name == "flooder") flood(text);
    if (m.text == "who") m.text = name;
    text(m);
  }));
  while (ros::ok()) ::pause();
}
