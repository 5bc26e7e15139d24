#pragma once

#include <string>
#include <vector>

#include "recordings/bag.h"

namespace lapservo::internal {

/// The topic of Image or CompressedImage with that name, else the only one; of a topic and what compresses it
/// (NAME/compressed) the former. Throws InputError, listing what is in the bag, where none or several remain.
const BagTopic& image_topic_of(const Bag& bag, const std::string& name);

/// The topic of JointState with that name; else .../ARM/measured_js, the only .../measured_js, or the only JointState,
/// but none of `others`, further arms, and none of a part of an arm (of PSM1/jaw/measured_js beside PSM1/measured_js).
/// nullptr where the bag holds no JointState and none is named. Throws InputError, as above, where none or several
/// remain.
const BagTopic* joint_topic_of(const Bag& bag, const std::string& name, const std::string& arm,
                               const std::vector<std::string>& others = {});

}  // namespace lapservo::internal
