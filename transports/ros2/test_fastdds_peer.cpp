// An arm's ears on Fast DDS, which ROS 2 uses by default: a reader of /PSM1/servo_jp as rmw_fastrtps makes one in the
// range LOCALHOST. Writes "writers N" as they come and go, and the first position of each setpoint, until it is
// killed.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <functional>
#include <memory>
#include <string>
#include <unistd.h>
#include <vector>

#include "lapservo/testing/fast_cdr.h"

namespace {
namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

// Its first position.
class JointState : public fast::TopicDataType {
 public:
  JointState() {
    setName("sensor_msgs::msg::dds_::JointState_");
    m_typeSize = 1024;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }
  bool serialize(void*, rtps::SerializedPayload_t*) override { return false; }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    eprosima::fastcdr::FastBuffer buffer(reinterpret_cast<char*>(payload->data), payload->length);
    eprosima::fastcdr::Cdr cdr(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, lapservo::testing::ros2_cdr);
    cdr.read_encapsulation();
    std::int32_t sec = 0;
    std::uint32_t nanosec = 0;
    std::string frame;
    std::vector<std::string> names;
    std::vector<double> positions;
    cdr >> sec >> nanosec >> frame >> names >> positions;
    *static_cast<double*>(data) = positions.at(0);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0u; };
  }
  void* createData() override { return new double; }
  void deleteData(void* data) override { delete static_cast<double*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

class Ears : public fast::DataReaderListener {
 public:
  void on_subscription_matched(fast::DataReader*, const fast::SubscriptionMatchedStatus& status) override {
    std::printf("writers %d\n", status.current_count);
    std::fflush(stdout);
  }
  void on_data_available(fast::DataReader* reader) override {
    double heard = 0;
    fast::SampleInfo info;
    while (reader->take_next_sample(&heard, &info) == eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
      if (info.valid_data) std::printf("%g\n", heard);
    }
    std::fflush(stdout);
  }
};

fast::DomainParticipantQos localhost_only() {
  fast::DomainParticipantQos qos;
  auto& discovery = qos.wire_protocol().builtin;
  discovery.metatrafficMulticastLocatorList.clear();
  discovery.metatrafficUnicastLocatorList.push_back(rtps::Locator_t());
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(std::make_shared<eprosima::fastdds::rtps::SharedMemTransportDescriptor>());
  const auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->maxInitialPeersRange = 32;
  qos.transport().user_transports.push_back(udp);
  rtps::Locator_t peer;
  rtps::IPLocator::setIPv4(peer, "127.0.0.1");
  discovery.initialPeersList.push_back(peer);
  return qos;
}

}  // namespace

int main() {
  const char* const domain = std::getenv("ROS_DOMAIN_ID");
  auto* const participant = fast::DomainParticipantFactory::get_instance()->create_participant(
      domain ? static_cast<std::uint32_t>(std::atoi(domain)) : 0, localhost_only());
  if (!participant) return 1;
  fast::TypeSupport type(new JointState);
  type.register_type(participant);
  auto* const topic = participant->create_topic("rt/PSM1/servo_jp", type.get_type_name(), fast::TOPIC_QOS_DEFAULT);
  fast::DataReaderQos qos;
  qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
  qos.history().depth = 10;
  Ears ears;
  auto* const subscriber = participant->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  if (!topic || !subscriber || !subscriber->create_datareader(topic, qos, &ears)) return 1;
  while (true) ::pause();
}
