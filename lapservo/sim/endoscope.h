#pragma once

#include <cstdint>
#include <deque>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/sim/renderer.h"

namespace lapservo {

struct EndoscopeConfig {
  double frame_rate_hz = 60;
  double exposure_s = 0;            ///< shutter open for so long; 0: frozen, without motion blur
  int exposure_moments = 5;         ///< that motion blur is made of
  double latency_s = 0.08;          ///< from the middle of the exposure to arrival
  double jitter_s = 0.001;          ///< arrival is evenly up to this much earlier or later
  double dropped_fraction = 0.005;  ///< of the frames that never arrive
  int render_threads = 2;           ///< frames are rendered while they are on their way; 0: on request
  bool real_time = false;  ///< nobody waits for an image: where it is not rendered in time, it is late or left out
  bool pictures = true;    ///< false: frames arrive without an image, for studies that need only their times

  /// Returns itself if all its numbers make sense; else throws InputError naming the first field that doesn't.
  const EndoscopeConfig& checked() const;
};

/// A frame as it arrives.
struct EndoscopePicture {
  long index = 0;        ///< of all frames exposed, those dropped included
  double exposed_s = 0;  ///< the middle of the exposure, which no real program knows
  double stamp_s = 0;    ///< when it arrived
  cv::Mat bgr;
};

/// A camera with frame rate, exposure, latency, jitter and lost frames on simulated time. Frame k's shutter opens at k
/// / frame_rate_hz. Images depend on the seed and on the scene before the camera, never on threads or real time.
class Endoscope {
 public:
  Endoscope(const Camera& camera, const std::vector<ShaftModel>& shafts, const cv::Mat& background,
            const RenderOptions& options, const EndoscopeConfig& config, std::uint64_t seed);

  ~Endoscope();
  Endoscope(Endoscope&&) noexcept;
  Endoscope& operator=(Endoscope&&) noexcept;

  /// The moments at which expose() wants to know where the shafts are, ascending.
  std::vector<double> next_moments_s() const;
  /// Takes the next frame, the shafts standing so at those moments.
  void expose(const Exposure& shafts);
  /// Frames that have arrived since the last call, in order of their exposure.
  std::vector<EndoscopePicture> arrived(double time_s);

  /// Light on the scene for frames to come: 1 is usual.
  void set_light(float light) { light_ = light; }

 private:
  struct Queue;
  struct OnTheWay {
    EndoscopePicture picture;
    std::future<cv::Mat> rendered;
  };

  bool falls_behind() const;

  EndoscopeConfig config_;
  Light gains_;
  std::uint64_t seed_;
  float light_ = 1;
  long next_ = 0;
  double last_stamp_s_ = 0;
  std::deque<OnTheWay> on_the_way_;
  std::unique_ptr<Queue> queue_;
};

}  // namespace lapservo
