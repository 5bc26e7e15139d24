#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "lapservo/core/random.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::testing {

inline constexpr int video_frames = 20;
inline const cv::Size video_size(320, 240);

/// A square that moves over noise: passes each of video_frames images of video_size to `write`.
template <typename Write>
void for_each_picture(const Write& write) {
  cv::RNG random(7);
  for (int i = 0; i < video_frames; ++i) {
    cv::Mat image(video_size, CV_8UC3);
    random.fill(image, cv::RNG::UNIFORM, 60, 200);
    image(cv::Rect(10 * i, 50, 40, 40)).setTo(cv::Scalar(20, 40, 250));
    write(image);
  }
}

/// The decoded content of a video of such images.
struct VideoRead {
  int frames = 0, damaged = 0;
  std::string complaint;
};

inline VideoRead read_video(const std::filesystem::path& path) {
  const auto source = open_frame_source(path.string(), 30);
  VideoRead result;
  while (const auto frame = source->next()) {
    EXPECT_EQ(frame->index, result.frames);
    EXPECT_EQ(frame->bgr.size(), video_size);
    ++result.frames;
    result.damaged += frame->flaw == Status::damaged;
  }
  result.complaint = source->complaint();
  return result;
}

/// Whether the command ffmpeg is there and can do this.
inline bool ffmpeg(const std::string& arguments) {
  return std::system(("ffmpeg -v quiet -y " + arguments).c_str()) == 0;
}

/// An image of 8 or 16 bits as a video of 25 frames a second, with these arguments for its output; see ffmpeg().
inline bool write_by_ffmpeg(const std::filesystem::path& path, const cv::Mat& bgr, const std::string& arguments,
                            int frames = 1) {
  const TemporaryFolder folder;
  write_file(folder / "raw", {reinterpret_cast<const char*>(bgr.data), bgr.total() * bgr.elemSize()});
  const std::string input = "-stream_loop " + std::to_string(frames - 1) + " -f rawvideo -pix_fmt " +
                            (bgr.depth() == CV_16U ? "bgr48le" : "bgr24") + " -s " + std::to_string(bgr.cols) + "x" +
                            std::to_string(bgr.rows) + " -r 25 -i '" + (folder / "raw").string() + "' ";
  return ffmpeg(input + arguments + " '" + path.string() + "'");
}

inline constexpr int patch_px = 64;

/// Patches of these colours, one beside the other.
inline cv::Mat patches_of(std::span<const cv::Vec3b> colours, int height_px) {
  cv::Mat bgr(height_px, patch_px * static_cast<int>(colours.size()), CV_8UC3);
  for (int i = 0; i < static_cast<int>(colours.size()); ++i)
    bgr.colRange(patch_px * i, patch_px * (i + 1)).setTo(colours[static_cast<std::size_t>(i)]);
  return bgr;
}

inline void expect_patches(const cv::Mat& bgr, std::span<const cv::Vec3b> colours, int tolerance) {
  for (int i = 0; i < static_cast<int>(colours.size()); ++i)
    for (int channel = 0; channel < 3; ++channel)
      EXPECT_NEAR(bgr.at<cv::Vec3b>(bgr.rows / 2, i * patch_px + patch_px / 2)[channel],
                  colours[static_cast<std::size_t>(i)][channel], tolerance)
          << "patch " << i << ", " << channel;
}

/// The bytes with 200 of them, from `from` on, drawn at random.
inline std::string with_damage(std::string bytes, std::size_t from, std::uint64_t seed) {
  internal::Random random(seed);
  for (std::size_t i = from; i < from + 200; ++i) bytes[i] = static_cast<char>(random.bits() & 0x7f);
  return bytes;
}

}  // namespace lapservo::testing
