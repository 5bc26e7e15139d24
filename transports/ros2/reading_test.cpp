#include "transports/ros2/reading.h"

#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/testing/wait_for.h"
#include "transports/ros2/ros2_transport.h"
#include "transports/ros2/test_dds_peer.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal::reading_test {

const std::string topic = "/PSM1/topic";

OperatingStateMessage state(int number) {
  return {0, std::to_string(number), true, false};
}
StringMessage text(int number) {
  return {0, std::to_string(number)};
}
int number_of(const OperatingStateMessage& message) {
  return std::stoi(message.state);
}
int number_of(const StringMessage& message) {
  return std::stoi(message.text);
}

template <typename Message>
std::vector<int> numbers_of(TestInbox<Message>& inbox) {
  std::vector<int> numbers;
  for (const Message& message : inbox.all()) numbers.push_back(number_of(message));
  return numbers;
}

std::vector<int> range(int first, int last) {
  std::vector<int> all;
  for (int k = first; k <= last; ++k) all.push_back(k);
  return all;
}

// Bursts of two to five messages by a writer of another participant, the next one when the last one came.
template <typename Message>
void expect_order(Delivery offered, Message (*numbered)(int)) {
  constexpr int bursts = 200;
  Ros2Transport to("to");
  const auto from = node_elsewhere();
  TestInbox<Message> heard;
  const auto subscription = to.subscribe<Message>(topic, heard.handler());
  const dds_entity_t writer = from->create_writer(topic, Wire<Message>::descriptor(), offered);
  heard.get([&] { Wire<Message>::write(writer, numbered(0)); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  heard.clear();
  int said = 0;
  for (int burst = 0; burst < bursts; ++burst) {
    for (int k = 0; k < 2 + burst % 4; ++k) Wire<Message>::write(writer, numbered(++said));
    const auto complete = [&] { return heard.count() >= static_cast<std::size_t>(said); };
    if (!testing::wait_for(complete, std::chrono::microseconds(50))) break;
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(numbers_of(heard), range(1, bursts * 7 / 2)) << static_cast<int>(offered);
}

TEST(Reading, StatesAndCommandsComeOnceInTheirOrderByWhateverTheirPublisherOffers) {
  for (const Delivery offered : {Delivery::latched, Delivery::reliable, Delivery::best_effort}) {
    expect_order(offered, state);
    expect_order(offered, text);
  }
}

// As of a program that says one thing and ends.
TEST(Reading, WhatAWriterSaidBeforeItWentComesOnceInItsOrder) {
  Ros2Transport to("to");
  const auto from = node_elsewhere();
  TestInbox<OperatingStateMessage> heard;
  const auto subscription = to.subscribe<OperatingStateMessage>(topic, heard.handler());
  const auto& type = Wire<OperatingStateMessage>::descriptor();
  int said = 0;
  for (int round = 0; round < 20; ++round) {
    const dds_entity_t writer = from->create_writer(topic, type, Delivery::reliable);
    wait_for_readers(writer, 2);
    for (int k = 0; k < 2; ++k) Wire<OperatingStateMessage>::write(writer, state(++said));
    from->remove(writer);
  }
  testing::wait_for([&] { return heard.count() >= static_cast<std::size_t>(said); });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(numbers_of(heard), range(1, said));
}

// At 30,000 a second, what comes in between would take 0.03 s.
TEST(Reading, AStopIsHeardThoughAnotherFloodsItsTopic) {
  constexpr int stops = 10, others = 1000;
  Ros2Transport to("to");
  std::atomic<int> last = 0;
  const auto subscription = to.subscribe<StringMessage>(topic, [&](StringMessage&& message) {
    if (const int number = number_of(message); number > 0) last = number;
  });
  const auto from = node_elsewhere(), other = node_elsewhere();
  const auto& type = Wire<StringMessage>::descriptor();
  const dds_entity_t writer = from->create_writer(topic, type, Delivery::reliable);
  for (const Delivery offered : {Delivery::reliable, Delivery::best_effort}) {
    const dds_entity_t flood = other->create_writer(topic, type, offered);
    for (const dds_entity_t one : {writer, flood}) wait_for_readers(one, 1);
    for (int stop = 1; stop <= stops; ++stop) {
      Wire<StringMessage>::write(writer, text(stop));
      for (int k = 0; k < others; ++k) Wire<StringMessage>::write(flood, text(0));
      for (int k = 0; k < 100 && last < stop; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(10));
      EXPECT_EQ(last, stop);
    }
    last = 0;
    other->remove(flood);
  }
}

}  // namespace lapservo::internal::reading_test
