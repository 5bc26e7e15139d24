#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "recordings/bag.h"

namespace lapservo::internal {

/// As the topic's first message that names any has them.
std::vector<std::string> joint_names_in_bag(const Bag& bag, const BagTopic& topic);

/// The arm's or wrist's joints in a bag's topic, by the times of their headers' stamps (stamped_messages.h) after
/// `begin_s`, or after the first reading where nothing else has such stamps. Readings that are no numbers are left out,
/// too. Throws InputError for messages without one of the joints or with one twice, for fewer than two readings, for
/// those of two arms, and where only one of joints and images is stamped since 1970.
JointRecording joints_in_bag(const Bag& bag, const BagTopic& topic, const Joints& joints, std::optional<double> begin_s,
                             JointsOf whose = JointsOf::arm);

/// By how much the clock that stamps `joints` is ahead of that of `images`, as when they were recorded shows. The
/// message of each topic that came fastest counts, as in the loop. Without `images`: ahead of the recorder's clock.
double clock_lead_s(const Bag& bag, const BagTopic& joints, const BagTopic* images);

}  // namespace lapservo::internal
