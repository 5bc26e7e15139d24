#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <variant>

#include "lapservo/crtk/first_sender.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/crtk/stamp_clock.h"
#include "lapservo/stream/image_stream.h"

namespace lapservo::internal {

/// Counts of a camera's images.
struct ImageCounts {
  long taken = 0;    ///< by newest()
  long skipped = 0;  ///< replaced by a newer one before it was taken
  long missing = 0;  ///< gaps of more than one and a half times the usual distance of stamps, in frames
  long repeated = 0, late = 0, jumped = 0, unstamped = 0;
  long resized = 0;        ///< of another size than the rig's camera
  long unreadable = 0;     ///< wrong encoding, wrong number of bytes, damaged
  long other_senders = 0;  ///< of another program than the one that counts
  /// "skipped 2, late 1"; empty when all were taken.
  std::string text() const;
};

/// Whose clock stamps are of: one that agrees with nobody's, or the loop's own.
enum class StampsBy { sender, loop };

/// A camera's image messages as an ImageStream: the newest, once, decoded by the caller. Only images with a stamp that
/// is newer than the last count, so a camera that repeats itself soon gives stale images; time_s is that of the fastest
/// image (StampClock), or the stamp where it is by the loop's clock. Images count from one sender, the first, until it
/// has been silent for 0.5 s. Unusable images and those of others are dropped, counted, and the reason is kept.
class ImageReceiver : public ImageStream {
 public:
  /// `camera`: the rig's.
  ImageReceiver(int width_px, int height_px, StampsBy stamps_by = StampsBy::sender)
      : size_(width_px, height_px), stamps_by_(stamps_by) {}

  // By the transport's threads, with the time of arrival on the loop's clock.
  using Message = std::variant<ImageMessage, CompressedImageMessage>;
  void receive(Message&& message, double arrival_s);

  std::optional<StampedImage> newest() override;

  ImageCounts counts() const;
  /// Why images were dropped last, in words; empty while none were.
  std::string complaint() const;
  /// True once when another sender appears beside the one that counts, or after it; and again after its absence of
  /// 0.5 s.
  bool take_second_sender() override;

 private:
  struct Waiting {
    double time_s = 0;
    Message message;
  };

  bool is_of_first_sender(std::uint64_t source, double arrival_s);
  void count_gap(double stamp_s);
  void refuse(long ImageCounts::*count, const std::string& why);

  cv::Size size_;
  StampsBy stamps_by_;
  mutable std::mutex mutex_;
  StampClock clock_{0.5};
  ImageCounts counts_;
  std::string complaint_;
  std::optional<Waiting> waiting_;
  std::optional<double> last_stamp_s_, distance_s_;
  FirstSender sender_;
  bool second_sender_ = false;
};

}  // namespace lapservo::internal
