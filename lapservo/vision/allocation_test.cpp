// Replaces the C library's allocation for this program alone: every way to the heap counts, OpenCV's and Eigen's too.
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"
#include "lapservo/vision/tracker.h"

namespace {

std::atomic<bool> counting = false;
std::atomic<int> allocations = 0;

void count() {
  if (counting) ++allocations;
}

}  // namespace

extern "C" {

void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  count();
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  count();
  return __libc_calloc(number, size);
}
void* realloc(void* pointer, std::size_t size) {
  count();
  return __libc_realloc(pointer, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  count();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  return memalign(alignment, size);
}
int posix_memalign(void** pointer, std::size_t alignment, std::size_t size) {
  *pointer = memalign(alignment, size);
  return *pointer ? 0 : ENOMEM;
}

}  // extern "C"

namespace lapservo::internal {
namespace {

/// Allocations while a tracker that has warmed up sees some frames of a slow motion.
int allocations_when_tracked(std::size_t instruments) {
  constexpr int warm_up = 3, frames = 8;
  const Rig rig = scenes::usual_rig(instruments);
  const std::vector<Eigen::Vector3d> places_m{{-0.02, 0.01, 0.1}, {0.04, 0, 0.1}, {0.006, -0.03, 0.1}};
  std::vector<JointVector> configurations;
  for (std::size_t i = 0; i < instruments; ++i)
    configurations.push_back(configuration_through(*rig.instruments[i].camera_from_rcm, places_m[i]).value());
  Tracker tracker(rig);
  int counted = 0;
  for (int frame = 0; frame < frames; ++frame) {
    for (JointVector& q : configurations) q.psi_rad += 0.03, q.theta_rad += 0.002;
    const cv::Mat image = scenes::render(rig, configurations, static_cast<std::uint64_t>(frame));
    allocations = 0;
    counting = frame >= warm_up;
    const std::vector<Observation>& observations = tracker.track(image);
    counting = false;
    counted += allocations;
    for (const Observation& observation : observations) EXPECT_EQ(observation.status, Status::ok) << "frame " << frame;
  }
  return counted;
}

TEST(Allocation, is_counted_by_every_way_to_the_heap) {
  allocations = 0;
  counting = true;
  const std::vector<int> by_new(10, 1);
  const cv::Mat by_opencv(10, 10, CV_8U);
  counting = false;
  EXPECT_GE(allocations, 2);
}

TEST(Allocation, does_not_happen_in_a_tracked_frame) {
  for (const std::size_t instruments : {1U, 3U}) EXPECT_EQ(allocations_when_tracked(instruments), 0) << instruments;
}

}  // namespace
}  // namespace lapservo::internal
