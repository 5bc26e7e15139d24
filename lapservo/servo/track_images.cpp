#include "lapservo/servo/track_images.h"

#include <chrono>
#include <exception>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "lapservo/kinematics/centre_line.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/moving_camera.h"
#include "lapservo/servo/picture_repeats.h"

namespace lapservo::internal {
namespace {

class CallersTracking : public TrackedImageStream {
 public:
  CallersTracking(ImageStream& images, const Rig& rig, const TrackerOptions& options,
                  const std::optional<Eigen::Vector2d>& rcm_px, const EndoscopePose* endoscope)
      : images_(images),
        rig_(rig),
        options_(options),
        tracker_(rig, options),
        endoscope_(endoscope),
        camera_from_rcm_(rig.instruments.front().camera_from_rcm),
        rcm_px_(rcm_image_px(rig, rcm_px)) {}

  std::optional<TrackedImage> newest() override {
    auto image = images_.newest();
    if (!image || (endoscope_ && !follow_endoscope(image->time_s - delay_s_))) return std::nullopt;
    TrackedImage tracked{std::move(*image), {}, {}, camera_from_rcm_, first_from_camera_};
    tracked.observations = tracker_.track(tracked.image.bgr, tracked.image.time_s);
    tracked.measurement = measurement_of(tracked.observations[0], tracked.image.time_s, rcm_px_);
    tracked.measurement.registration = registration_;
    tracked.measurement.repetition = repeats_.add(tracked.image.bgr);
    return tracked;
  }
  void use(const ServoDecision& by) override {
    registration_ = by.registration;
    // Where the others' are in a moved camera is not measured.
    for (Instrument& instrument : rig_.instruments) instrument.camera_from_rcm.reset();
    rig_.instruments.front().camera_from_rcm = by.camera_from_rcm;
    rig_.instruments.front().registration_covariance = by.registration_covariance;
    tracker_ = Tracker(rig_, options_);
    camera_from_rcm_ = by.camera_from_rcm;
    rcm_px_ = rcm_image_px(rig_, std::nullopt);
  }

 private:
  // False where the endoscope is not known at that time.
  bool follow_endoscope(double exposed_s) {
    const auto first_from_camera = endoscope_->first_from_camera(exposed_s);
    if (!first_from_camera) return false;
    first_from_camera_ = *first_from_camera;
    for (std::size_t i = 0; i < rig_.instruments.size(); ++i) {
      if (!rig_.instruments[i].camera_from_rcm) continue;
      const Instrument moved = before_moved_camera(rig_.instruments[i], *first_from_camera);
      tracker_.set_registration(i, *moved.camera_from_rcm, *moved.registration_covariance);
      if (i > 0) continue;
      camera_from_rcm_ = moved.camera_from_rcm;
      rcm_px_ = projected_rcm_px(rig_.camera, *camera_from_rcm_);
    }
    return true;
  }

  ImageStream& images_;
  Rig rig_;
  TrackerOptions options_;
  Tracker tracker_;
  const EndoscopePose* endoscope_;
  std::optional<Rigid3> camera_from_rcm_;  // of the first instrument, now
  Rigid3 first_from_camera_;
  std::optional<Eigen::Vector2d> rcm_px_;
  int registration_ = 0;
  PictureRepeats repeats_;
};

class OwnThreadTracking : public TrackedImageStream {
 public:
  explicit OwnThreadTracking(std::unique_ptr<TrackedImageStream> tracking)
      : tracking_(std::move(tracking)), thread_([this](const std::stop_token& stop) { work(stop); }) {}

  std::optional<TrackedImage> newest() override {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return std::exchange(latest_, std::nullopt);
  }
  void use(const ServoDecision& by) override {
    const std::lock_guard lock(mutex_);
    wanted_ = by;
  }

 private:
  void work(const std::stop_token& stop) {
    constexpr std::chrono::microseconds between_looks(500);
    try {
      while (!stop.stop_requested()) {
        if (const auto wanted = take_wanted()) tracking_->use(*wanted);
        tracking_->set_delay(delay_s_);
        auto tracked = tracking_->newest();
        if (!tracked) {
          std::this_thread::sleep_for(between_looks);
          continue;
        }
        const std::lock_guard lock(mutex_);
        // The loop does not get the repeated image.
        if (latest_ && latest_->measurement.repetition == Repetition::none)
          tracked->measurement.repetition = Repetition::none;
        latest_ = std::move(tracked);
      }
    } catch (...) {
      const std::lock_guard lock(mutex_);
      failure_ = std::current_exception();
    }
  }

  std::optional<ServoDecision> take_wanted() {
    const std::lock_guard lock(mutex_);
    return std::exchange(wanted_, std::nullopt);
  }

  std::unique_ptr<TrackedImageStream> tracking_;
  std::mutex mutex_;
  std::optional<TrackedImage> latest_;
  std::optional<ServoDecision> wanted_;
  std::exception_ptr failure_;
  std::jthread thread_;  // last: it uses the others
};

}  // namespace

std::unique_ptr<TrackedImageStream> track_images(ImageStream& images, const Rig& rig, const TrackerOptions& options,
                                                 const std::optional<Eigen::Vector2d>& rcm_px, TrackingThread thread,
                                                 const EndoscopePose* endoscope) {
  auto tracking = std::make_unique<CallersTracking>(images, rig, options, rcm_px, endoscope);
  if (thread == TrackingThread::callers) return tracking;
  return std::make_unique<OwnThreadTracking>(std::move(tracking));
}

}  // namespace lapservo::internal
