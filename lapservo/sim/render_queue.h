#pragma once

#include <cstdint>
#include <future>
#include <thread>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/core/bounded_queue.h"
#include "lapservo/sim/renderer.h"

namespace lapservo::internal {

struct RenderJob {
  Exposure exposure;
  std::uint64_t seed = 0;
  Light gains = Light(1, 1, 1);
};

/// Renders in the background, in whichever thread is free. An image depends on its job alone.
class RenderQueue {
 public:
  /// Every thread renders with a copy of `renderer`. Without threads a job runs when its result is requested.
  RenderQueue(Renderer renderer, int threads);
  ~RenderQueue();
  RenderQueue(const RenderQueue&) = delete;
  RenderQueue& operator=(const RenderQueue&) = delete;

  /// Unrequested results are dropped; requested ones must be taken before the queue is destroyed.
  std::future<cv::Mat> render(RenderJob job);

 private:
  using Task = std::packaged_task<cv::Mat(Renderer&)>;
  void work(Renderer& renderer);

  std::vector<Renderer> renderers_;
  BoundedQueue<Task> tasks_;
  std::vector<std::thread> threads_;
};

}  // namespace lapservo::internal
