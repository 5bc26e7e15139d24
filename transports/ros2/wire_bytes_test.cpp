// The bytes on the wire, read by eProsima's Fast CDR, which ROS 2's nodes use by default, along the .msg files: every
// field has its number, in its place, and nothing is left over.

#include <dds/ddsi/ddsi_serdata.h>
#include <fstream>
#include <limits>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/testing/fast_cdr.h"
#include "lapservo/testing/sample_frames.h"
#include "transports/ros2/dds_node.h"
#include "transports/ros2/test_dds_peer.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal::wire_bytes_test {

using eprosima::fastcdr::Cdr;
using Fields = std::map<std::string, std::string>;  // by name: pose.pose.position.x, status[0].values[1].key

class MessageReader {
 public:
  explicit MessageReader(std::vector<char> bytes)
      : bytes_(std::move(bytes)),
        buffer_(bytes_.data(), bytes_.size()),
        cdr_(buffer_, Cdr::LITTLE_ENDIANNESS, lapservo::testing::ros2_cdr) {
    cdr_.read_encapsulation();
  }

  Fields read(const std::string& type) {
    read_message(type, "");
    EXPECT_LT(bytes_.size() - lapservo::testing::bytes_of(cdr_), 4u) << "left over";
    return fields_;
  }

 private:
  void read_message(const std::string& type, const std::string& prefix) {
    const std::size_t slash = type.find('/');
    const std::string package = type.substr(0, slash);
    std::ifstream file(testing::source_folder() / "transports/ros2/msg" / package / "msg" /
                       (type.substr(slash + 1) + ".msg"));
    ASSERT_TRUE(file) << type;
    static const std::regex field(R"(([^\s\[#]+)(\[(\d*)\])?\s+(\w+).*)");
    std::smatch part;
    for (std::string line; std::getline(file, line);)
      if (std::regex_match(line, part, field))
        read_field(part[1], package, part[2].matched, part[3], prefix + std::string(part[4]));
  }
  void read_field(const std::string& type, const std::string& package, bool is_array, const std::string& size,
                  const std::string& name) {
    if (!is_array) return read_value(type, package, name);
    const auto count = size.empty() ? number<std::uint32_t>() : static_cast<std::uint32_t>(std::stoul(size));
    fields_[name] = fmt::format("{} of them", count);
    for (std::uint32_t i = 0; i < count; ++i) read_value(type, package, fmt::format("{}[{}]", name, i));
  }
  void read_value(const std::string& type, const std::string& package, const std::string& name) {
    const auto set = [&](const auto& value) { fields_[name] = fmt::format("{}", value); };
    if (type == "float64") return set(number<double>());
    if (type == "float32") return set(number<float>());
    if (type == "int32") return set(number<std::int32_t>());
    if (type == "uint32") return set(number<std::uint32_t>());
    if (type == "uint8" || type == "byte") return set(number<std::uint8_t>());
    if (type == "bool") return set(number<bool>());
    if (type == "string") return set(number<std::string>());
    read_message(type.find('/') == std::string::npos ? package + "/" + type : type, name + ".");
  }
  template <typename T>
  T number() {
    T value{};
    cdr_ >> value;
    return value;
  }

  std::vector<char> bytes_;
  eprosima::fastcdr::FastBuffer buffer_;
  Cdr cdr_;
  Fields fields_;
};

// As DDS sends them. Writer and reader are of one process, and wait for nobody.
template <typename Message>
std::vector<char> sent(const Message& message) {
  const DdsNode node("wire_bytes", test_domain());
  const dds_entity_t participant = node.participant();
  const dds_entity_t topic =
      dds_create_topic(participant, &Wire<Message>::descriptor(), "wire_bytes", nullptr, nullptr);
  const dds_entity_t reader = dds_create_reader(participant, topic, nullptr, nullptr);
  const dds_entity_t writer = dds_create_writer(participant, topic, nullptr, nullptr);
  Wire<Message>::write(writer, message);
  ddsi_serdata* data = nullptr;
  dds_sample_info_t info;
  std::vector<char> bytes;
  if (dds_takecdr(reader, &data, 1, &info, DDS_ANY_STATE) == 1) {
    bytes.resize(ddsi_serdata_size(data));
    ddsi_serdata_to_ser(data, 0, bytes.size(), bytes.data());
    ddsi_serdata_unref(data);
  }
  return bytes;
}

template <typename Message>
Fields sent_as(const std::string& type, const Message& message) {
  auto bytes = sent(message);
  if (bytes.size() < 4) {
    ADD_FAILURE() << "nothing was sent of " << type;
    return {};
  }
  return MessageReader(std::move(bytes)).read(type);
}

// `expected`: "NAME VALUE, NAME VALUE"; an array's value is "N of them".
void expect_fields(const Fields& found, const std::string& expected) {
  static const std::regex field(R"((\S+) ([^,]*)(, )?)");
  for (auto at = std::sregex_iterator(expected.begin(), expected.end(), field); at != std::sregex_iterator(); ++at) {
    const auto read = found.find((*at)[1]);
    ASSERT_TRUE(read != found.end()) << (*at)[1];
    EXPECT_EQ(read->second, (*at)[2]) << (*at)[1];
  }
}

constexpr double stamp_s = 1700000000.25;
const std::string stamp = "header.stamp.sec 1700000000, header.stamp.nanosec 250000000, ";

TEST(WireBytes, OfWhatSteersAnArm) {
  const Fields joints =
      sent_as("sensor_msgs/JointState", JointMessage{stamp_s, {"yaw", "", "pitch"}, {0.25, -1.5, 1e-300}, {4, 5, 6}});
  expect_fields(joints,
                stamp +
                    "header.frame_id , name 3 of them, name[0] yaw, name[1] , name[2] pitch, position 3 of them, "
                    "position[0] 0.25, position[1] -1.5, position[2] 1e-300, velocity 3 of them, velocity[2] 6, "
                    "effort 0 of them");
  const TrajectoryMessage trajectory{stamp_s, {"s_rad", "r_px"}, {{0, {1, 2}}, {2.25, {3, 4}}}};
  expect_fields(sent_as("trajectory_msgs/JointTrajectory", trajectory),
                "joint_names[1] r_px, points 2 of them, points[0].velocities 0 of them, points[1].positions[1] 4, "
                "points[1].time_from_start.sec 2, points[1].time_from_start.nanosec 250000000");
  expect_fields(sent_as("crtk_msgs/OperatingState", OperatingStateMessage{stamp_s, "ENABLED", true, false}),
                stamp + "state ENABLED, is_homed true, is_busy false");
  expect_fields(sent_as("crtk_msgs/StringStamped", StringMessage{stamp_s, "enable"}), "string enable");
  expect_fields(sent_as("std_msgs/Bool", BoolMessage{true}), "data true");
}

TEST(WireBytes, OfPictures) {
  const Fields image =
      sent_as("sensor_msgs/Image", ImageMessage{stamp_s, 2, 1, 7, "rgb8", true, {1, 2, 3, 4, 5, 6, 255}, 0, "e"});
  expect_fields(image, stamp + "header.frame_id e, height 1, width 2, encoding rgb8, is_bigendian 1, step 7, " +
                           "data 7 of them, data[6] 255");
  expect_fields(sent_as("sensor_msgs/CompressedImage", CompressedImageMessage{stamp_s, "jpeg", {7, 8}, 0, "e"}),
                "header.frame_id e, format jpeg, data 2 of them, data[1] 8");
  const CameraInfoMessage camera{stamp_s, 640, 360, {1, 2, 3, 4, 5}, {550, 0, 319.5, 0, 551, 179.5, 0, 0, 1}, "e"};
  expect_fields(sent_as("sensor_msgs/CameraInfo", camera),
                "header.frame_id e, height 360, width 640, distortion_model plumb_bob, d 5 of them, d[4] 5, k[4] 551, "
                "r[0] 1, r[1] 0, p[6] 179.5, p[3] 0, binning_x 0, roi.do_rectify false");
}

TEST(WireBytes, OfWhatTheLoopTells) {
  PoseMessage pose{stamp_s, "endoscope", {1, 2, 3}, {0, 0.6, 0, 0.8}, {}};
  pose.covariance[35] = 5;
  expect_fields(sent_as("geometry_msgs/PoseWithCovarianceStamped", pose),
                stamp +
                    "header.frame_id endoscope, pose.pose.position.z 3, pose.pose.orientation.y 0.6, "
                    "pose.pose.orientation.w 0.8, pose.covariance[34] 0, pose.covariance[35] 5");
  const Rigid3 place{Eigen::Quaterniond(0.8, 0, 0.6, 0), {1, 2, 3}};
  expect_fields(sent_as("geometry_msgs/PoseStamped", PlaceMessage{stamp_s, "camera", place}),
                stamp + "header.frame_id camera, pose.position.z 3, pose.orientation.y 0.6, pose.orientation.w 0.8");
  expect_fields(sent_as("tf2_msgs/TFMessage", TransformsMessage{stamp_s, {{"a", "b", {}}, {"c", "d", place}}}),
                "transforms 2 of them, transforms[0].header.stamp.sec 1700000000, transforms[1].header.frame_id c, "
                "transforms[1].child_frame_id d, transforms[1].transform.translation.z 3, "
                "transforms[1].transform.rotation.y 0.6, transforms[1].transform.rotation.w 0.8");
  const CylindersMessage::Cylinder band{place, 0.5, 0.25, {1, 0.5, 0.25, 0.125}};
  expect_fields(sent_as("visualization_msgs/MarkerArray", CylindersMessage{stamp_s, "endoscope", "PSM1", {{}, band}}),
                "markers 2 of them, markers[1].header.frame_id endoscope, markers[1].ns PSM1, markers[1].id 1, "
                "markers[1].type 3, markers[1].action 0, markers[1].pose.position.z 3, "
                "markers[1].pose.orientation.w 0.8, markers[1].scale.x 0.5, markers[1].scale.y 0.5, "
                "markers[1].scale.z 0.25, markers[1].color.r 1, markers[1].color.a 0.125, "
                "markers[1].lifetime.nanosec 500000000, markers[1].text , markers[1].mesh_file.data 0 of them");
  const DiagnosticMessage state{
      stamp_s, DiagnosticMessage::Level::error, "lapservo", "hold", {{"reason", "outlier"}, {"delay_s", ""}}};
  expect_fields(sent_as("diagnostic_msgs/DiagnosticArray", state),
                "status 1 of them, status[0].level 2, status[0].name lapservo, status[0].message hold, "
                "status[0].hardware_id , status[0].values 2 of them, status[0].values[0].value outlier, "
                "status[0].values[1].key delay_s");
  ObservationMessage seen;
  seen.stamp_s = stamp_s;
  seen.frame = "endoscope", seen.instrument = "PSM1", seen.status = "ok", seen.action = "track", seen.reason = "";
  seen.q = {1, 2, 3, std::numeric_limits<double>::quiet_NaN()};
  seen.q_covariance[15] = 4, seen.features[0] = 5, seen.feature_covariance[1] = 6, seen.edges_px[7] = 7;
  seen.error = {8, 9, 10, 11};
  expect_fields(sent_as("lapservo_msgs/Observation", seen),
                "instrument PSM1, status ok, q[2] 3, q[3] nan, q_covariance[15] 4, features[0] 5, "
                "feature_covariance[1] 6, edges_px[7] 7, action track, reason , error[3] 11");
}

}  // namespace lapservo::internal::wire_bytes_test
