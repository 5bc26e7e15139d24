#include "lapservo/sim/render_queue.h"

#include <cstddef>
#include <utility>

namespace lapservo::internal {
namespace {

cv::Mat done(Renderer& renderer, const RenderJob& job) {
  renderer.set_gains(job.gains);
  return renderer.render_exposure(job.exposure, job.seed);
}

}  // namespace

RenderQueue::RenderQueue(Renderer renderer, int threads) {
  for (int i = 1; i < threads; ++i) renderers_.push_back(renderer.clone());
  renderers_.push_back(std::move(renderer));
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { work(renderers_[static_cast<std::size_t>(i)]); });
}

RenderQueue::~RenderQueue() {
  tasks_.cancel();
  for (std::thread& thread : threads_) thread.join();
}

std::future<cv::Mat> RenderQueue::render(RenderJob job) {
  if (threads_.empty())
    return std::async(std::launch::deferred, [this, job = std::move(job)] { return done(renderers_.front(), job); });
  Task task([job = std::move(job)](Renderer& renderer) { return done(renderer, job); });
  std::future<cv::Mat> result = task.get_future();
  tasks_.push(std::move(task));
  return result;
}

void RenderQueue::work(Renderer& renderer) {
  while (auto task = tasks_.pop()) (*task)(renderer);
}

}  // namespace lapservo::internal
