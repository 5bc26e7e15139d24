#include "lapservo/vision/tracker.h"

#include <type_traits>
#include <utility>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

// `for (const Observation& o : Tracker(rig).track(image))` once read freed memory.
TEST(Tracker, OneThatIsATemporaryGivesItsObservationsAway) {
  const bool by_value =
      std::is_same_v<decltype(std::declval<Tracker>().track(std::declval<cv::Mat>())), std::vector<Observation>>;
  const bool by_reference = std::is_same_v<decltype(std::declval<Tracker&>().track(std::declval<cv::Mat>())),
                                           const std::vector<Observation>&>;
  EXPECT_TRUE(by_value);
  EXPECT_TRUE(by_reference);
}

}  // namespace
}  // namespace lapservo::internal
