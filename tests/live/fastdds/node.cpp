// SPDX-FileCopyrightText: 2026 The fieldtruth authors
// SPDX-License-Identifier: Apache-2.0
// A node as ROS 2's default middleware makes it: hears topics for some seconds and drives by /cmd_vel.
// node SECONDS SPEED TURN_RATE; prints a line for each message: TOPIC STAMP_NS FRAME SIZE CHECKSUM.
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include "rosPubSubTypes.h"

using namespace eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using Time = builtin_interfaces::msg::dds_::Time_;

struct Line {
  int64_t stamp;
  std::string frame;
  size_t size;
  uint32_t sum;
};

int64_t ns(const Time& t) { return t.sec() * INT64_C(1000000000) + t.nanosec(); }

uint32_t sum(const std::vector<uint8_t>& data) {  // Adler-32
  uint32_t a = 1, b = 0;
  for (uint8_t byte : data) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  return b << 16 | a;
}

Line line(const rosgraph_msgs::msg::dds_::Clock_& m) { return {ns(m.clock()), "-", 0, 0}; }
Line line(const tf2_msgs::msg::dds_::TFMessage_& m) {
  const auto& first = m.transforms().at(0);
  return {ns(first.header().stamp()), first.child_frame_id(), m.transforms().size(), 0};
}
Line line(const sensor_msgs::msg::dds_::Imu_& m) {
  return {ns(m.header().stamp()), m.header().frame_id(), static_cast<size_t>(1000 * m.linear_acceleration().z()), 0};
}
template <typename Message>
Line line(const Message& m) {
  return {ns(m.header().stamp()), m.header().frame_id(), m.data().size(), sum(m.data())};
}

template <typename Message>
class Listener : public DataReaderListener {
 public:
  explicit Listener(const char* topic) : topic_(topic) {}
  void on_data_available(DataReader* reader) override {
    Message message;
    SampleInfo info;
    while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const Line l = line(message);
      std::printf("%s %" PRId64 " %s %zu %" PRIu32 "\n", topic_, l.stamp, l.frame.c_str(), l.size, l.sum);
      std::fflush(stdout);
    }
  }

 private:
  const char* topic_;
};

template <typename Support, typename Message>
void hear(DomainParticipant* node, Subscriber* subscriber, const char* topic, bool latched = false) {
  TypeSupport type(new Support());
  type.register_type(node);
  DataReaderQos qos = DATAREADER_QOS_DEFAULT;
  qos.reliability().kind = latched ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().depth = 5;
  qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  Topic* made = node->create_topic(std::string("rt") + topic, type.get_type_name(), TOPIC_QOS_DEFAULT);
  subscriber->create_datareader(made, qos, new Listener<Message>(topic));
}

int main(int, char** argument) {
  const double seconds = std::atof(argument[1]), speed = std::atof(argument[2]), turn_rate = std::atof(argument[3]);
  DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
  const char* number = std::getenv("ROS_DOMAIN_ID");
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");  // as with ROS_LOCALHOST_ONLY=1
  udp->receiveBufferSize = 4 << 20;  // clouds and images come at once; the default of 208 kB loses some
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  DomainParticipant* node =
      DomainParticipantFactory::get_instance()->create_participant(number ? std::atoi(number) : 0, qos);
  Subscriber* subscriber = node->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  using namespace sensor_msgs::msg::dds_;
  hear<PointCloud2_PubSubType, PointCloud2_>(node, subscriber, "/turning/points");
  hear<Image_PubSubType, Image_>(node, subscriber, "/zed/left/tag/img_raw");
  hear<Imu_PubSubType, Imu_>(node, subscriber, "/imu/data");
  using Clock = rosgraph_msgs::msg::dds_::Clock_;
  hear<rosgraph_msgs::msg::dds_::Clock_PubSubType, Clock>(node, subscriber, "/clock");
  using Transforms = tf2_msgs::msg::dds_::TFMessage_;
  using TransformsSupport = tf2_msgs::msg::dds_::TFMessage_PubSubType;
  hear<TransformsSupport, Transforms>(node, subscriber, "/tf");
  hear<TransformsSupport, Transforms>(node, subscriber, "/tf_static", true);

  TypeSupport type(new geometry_msgs::msg::dds_::Twist_PubSubType());
  type.register_type(node);
  Topic* topic = node->create_topic("rt/cmd_vel", type.get_type_name(), TOPIC_QOS_DEFAULT);
  DataWriter* writer = node->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, DATAWRITER_QOS_DEFAULT);
  geometry_msgs::msg::dds_::Twist_ twist;
  twist.linear().x(speed);
  twist.angular().z(turn_rate);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    if (speed != 0.0 || turn_rate != 0.0) writer->write(&twist);
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  std::_Exit(0);
}
