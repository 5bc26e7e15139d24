#include "python/src/python_frames.h"

#include <cmath>
#include <mutex>
#include <utility>

#include <fmt/format.h>

#include "cameras/camera.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_filter.h"
#include "recordings/bag_frames.h"
#include "recordings/open_bag.h"

namespace lapservo::python {
namespace {

constexpr const char* named = "frames";

// One after another, copied: they are kept longer than Python may.
class IteratedFrames : public FrameSource {
 public:
  IteratedFrames(const py::object& given, double fps, bool of_one_recording)
      : iterator_(py::iter(given)), fps_(fps), of_one_recording_(of_one_recording) {
    if (py::hasattr(given, "__len__")) count_ = static_cast<int>(py::len(given));
  }

  std::optional<Frame> next() override {
    const py::gil_scoped_acquire mine;
    const auto item = py::reinterpret_steal<py::object>(PyIter_Next(iterator_.ptr()));
    if (!item && PyErr_Occurred()) throw py::error_already_set();
    if (!item) return std::nullopt;
    Frame frame = frame_of(item);
    check_time(frame.time_s);
    frame.index = index_++;
    return frame;
  }
  Kind kind() const override { return Kind::folder; }
  std::optional<int> frame_count() const override { return count_; }
  double frames_per_second() const override { return fps_; }

 private:
  void check_time(double time_s) {
    const bool rises = !of_one_recording_ || !last_s_ || time_s > *last_s_;
    if (!std::isfinite(time_s) || !rises)
      throw InputError(named, fmt::format("item {}", index_), fmt::format("at {} s", time_s),
                       last_s_ && of_one_recording_
                           ? fmt::format("a time after the {} s of the one before it", *last_s_)
                           : "a finite time");
    last_s_ = time_s;
  }
  Frame frame_of(const py::object& item) const {
    if (py::isinstance<Frame>(item)) return item.cast<Frame>();
    Frame frame;
    frame.time_s = index_ / fps_;
    if (!py::isinstance<py::tuple>(item)) return frame.bgr = picture_of(item), frame;
    const auto pair = item.cast<py::tuple>();
    if (pair.size() != 2) throw InputError(named, "item", std::string(py::repr(item)), "(time_s, uint8[H, W, 3])");
    frame.time_s = number_of(pair[0], named, Numbers::any);
    frame.bgr = picture_of(pair[1]);
    return frame;
  }
  static cv::Mat picture_of(const py::object& item) {
    if (!py::isinstance<py::array>(item))
      throw InputError(named, "item", std::string(py::str(py::type::of(item))),
                       "uint8[H, W, 3], (time_s, uint8[H, W, 3]) or lapservo.Frame");
    return view_of(item, named).clone();
  }

  py::iterator iterator_;
  double fps_;
  bool of_one_recording_;
  std::optional<int> count_;
  std::optional<double> last_s_;
  int index_ = 0;
};

// For threads that share it; called without Python's lock, which others hold while they wait for this one.
class SharedFrames : public internal::FrameFilter {
 public:
  using FrameFilter::FrameFilter;

  std::optional<Frame> next() override {
    const std::lock_guard lock(mutex_);
    return FrameFilter::next();
  }
  std::string complaint() const override {
    const std::lock_guard lock(mutex_);
    return FrameFilter::complaint();
  }

 private:
  mutable std::mutex mutex_;
};

void check_rate(double fps) {
  if (!(fps >= 0.001 && fps <= 1000))
    throw InputError("fps", "number", fmt::format("{}", fps), "0.001 to 1000 frames per second");
}

}  // namespace

std::unique_ptr<FrameSource> open_path(const std::string& path, double fps, const VideoReading& reading,
                                       const std::string& image_topic) {
  check_rate(fps);
  if (internal::is_bag(path))
    return std::make_unique<SharedFrames>(std::make_unique<internal::BagFrames>(internal::open_bag(path), image_topic));
  if (!image_topic.empty()) throw InputError("image_topic", "name", image_topic, "'' for what is no bag, as " + path);
  return std::make_unique<SharedFrames>(internal::open_camera_or_file(path, fps, {}, is_interrupted, reading));
}

bool is_path(const py::object& given) {
  return py::isinstance<py::str>(given) || py::hasattr(given, "__fspath__");
}

GivenFrames::GivenFrames(const py::object& given, double fps, const Camera* camera, bool deinterlace,
                         bool of_one_recording)
    : kept(given), name(named) {
  check_rate(fps);
  if (is_path(given)) {
    name = given.cast<std::filesystem::path>().string();
    owned = open_path(name, fps, {deinterlace || (camera && camera->deinterlace)});
  } else if (!py::isinstance<FrameSource>(given)) {
    owned = std::make_unique<IteratedFrames>(given, fps, of_one_recording);
  }
  source = owned ? owned.get() : given.cast<FrameSource*>();
  // As the command line says it; of a FrameSource its owner knows.
  const std::string remark = owned ? owned->remark() : "";
  if (!remark.empty() && PyErr_WarnEx(PyExc_UserWarning, (name + ": " + remark).c_str(), 1) != 0)
    throw py::error_already_set();
  if (camera) internal::expect_srgb(source->is_srgb(), name, camera->response);
}

}  // namespace lapservo::python
