#include "lapservo/io/frame_source.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/core/input_file.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/pictures/picture_order.h"
#include "lapservo/io/pictures/picture_parts.h"
#include "lapservo/io/pictures/png_picture.h"
#include "lapservo/io/video/video_reader.h"

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;

struct Pictures {
  PictureOrder order;
  int unread = 0;  ///< beside them, of formats that are not read
};

std::optional<Transfer> transfer_in(const fs::path& path) {
  std::vector<std::uint8_t> head(std::size_t{1} << 16);
  std::ifstream file(path, std::ios::binary);
  file.read(reinterpret_cast<char*>(head.data()), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file.gcount()));
  return png_transfer(head);
}

std::string remark_on(const Pictures& pictures, const std::vector<fs::path>& files,
                      const std::optional<Transfer>& transfer) {
  std::vector<std::string> remarks;
  if (transfer) remarks.push_back(remark_on_transfer(*transfer));
  if (pictures.unread > 0)
    remarks.push_back(
        fmt::format("{} images in TIFF, HEIC, AVIF or DICOM are left out: convert them to PNG", pictures.unread));
  if (pictures.order.is_ambiguous)
    remarks.push_back(fmt::format("points and signs of the numbers in the names decide the order: {}, {} ... {}",
                                  files[0].filename().string(), files[1].filename().string(),
                                  files.back().filename().string()));
  return fmt::format("{}", fmt::join(remarks, "; "));
}

class PictureSource : public FrameSource {
 public:
  PictureSource(Kind kind, Pictures pictures, double fps)
      : kind_(kind),
        files_(std::move(pictures.order.files)),
        transfer_(transfer_in(files_.front())),
        remark_(remark_on(pictures, files_, transfer_)),
        fps_(fps) {}

  std::optional<Frame> next() override {
    if (next_ == files_.size()) return std::nullopt;
    const fs::path& file = files_[next_];
    const std::string content = read_input(file, max_picture_bytes, "an image");
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(content.data()), content.size());
    Picture picture = decode_picture(bytes, file.string());
    if (const auto transfer = png_transfer(bytes); !picture.flaw && transfer != transfer_)
      throw InputError(file.string(), "transfer", name_of(transfer),
                       fmt::format("{} as in {}: put the images of each encoding into a folder of its own",
                                   name_of(transfer_), files_.front().filename().string()));
    Frame frame{std::move(picture.bgr), static_cast<int>(next_), static_cast<double>(next_) / fps_, file, picture.flaw};
    frame.is_srgb = is_srgb();
    ++next_;
    low_bits_ += picture.low_bits;
    return frame;
  }
  std::string remark() const override { return remark_; }
  bool is_srgb() const override { return transfer_.has_value(); }
  std::string complaint() const override {
    if (low_bits_ == 0 || low_bits_ < next_) return "";
    return "has 16 bits a channel of which at most the lower 12 are used: multiply the values by 16 where the camera "
           "has 12 bits, by 256 where it has 8";
  }
  Kind kind() const override { return kind_; }
  std::optional<int> frame_count() const override { return static_cast<int>(files_.size()); }
  double frames_per_second() const override { return fps_; }

 private:
  Kind kind_;
  std::vector<fs::path> files_;
  std::optional<Transfer> transfer_;
  std::string remark_;
  double fps_;
  std::size_t next_ = 0, low_bits_ = 0;
};

Pictures pictures_in(const fs::path& folder) {
  std::vector<fs::path> files;
  int unread = 0;
  std::error_code error;
  const fs::directory_iterator entries(folder, error);
  if (error) throw InputError(folder.string(), "can't be read (" + error.message() + "), expected a folder of images");
  for (const auto& entry : entries) {
    const bool hidden = entry.path().filename().string().starts_with(".");
    if (!hidden && has_image_extension(entry.path()) && entry.is_symlink(error) && !entry.exists(error))
      throw InputError(entry.path().string(),
                       "is a link to no file, expected an image: fetch what it names, or remove the link");
    if (hidden || !entry.is_regular_file(error)) continue;
    if (has_image_extension(entry.path())) files.push_back(entry.path());
    unread += has_unread_extension(entry.path());
  }
  if (files.empty())
    throw InputError(folder.string(), std::string("has no images") +
                                          (unread > 0 ? " but in TIFF, HEIC, AVIF or DICOM" : "") +
                                          ", expected some (png, jpg, bmp, webp, ppm)");
  PictureOrder order = ordered_pictures(std::move(files));
  const auto copy = std::ranges::adjacent_find(order.files, {}, [](const fs::path& file) { return file.stem(); });
  if (copy != order.files.end())
    throw InputError(folder.string(), fmt::format("has {} and {}, expected one image of a name: put the images of each "
                                                  "format into a folder of their own",
                                                  copy->filename().string(), copy[1].filename().string()));
  return {std::move(order), unread};
}

void refuse_dicom(const fs::path& path) {
  constexpr std::size_t preamble = 128;
  std::array<char, preamble + 4> head{};
  std::ifstream(path, std::ios::binary).read(head.data(), head.size());
  if (std::string_view(head.data(), head.size()).substr(preamble) == "DICM")
    throw InputError(path.string(),
                     "is DICOM, which is not read: write its frames as PNG into a folder (of dcmtk: "
                     "dcmj2pnm --all-frames --write-png FILE FOLDER/frame)");
}

}  // namespace

std::unique_ptr<FrameSource> open_frame_source(const std::string& input, double folder_fps,
                                               const VideoReading& reading) {
  using Kind = FrameSource::Kind;
  if (input.find("://") != std::string::npos) return open_video(input, Kind::live, reading, std::chrono::seconds(30));
  std::error_code error;
  const bool exists = fs::exists(input, error);
  if (error == std::errc::permission_denied) throw InputError(input, "can't be looked at: " + error.message());
  if (!exists)  // or a name that no file can have
    throw InputError(input, "does not exist, expected an image, a folder of images or a video");
  if (fs::is_directory(input)) return std::make_unique<PictureSource>(Kind::folder, pictures_in(input), folder_fps);
  if (fs::is_regular_file(input) && fs::file_size(input) == 0)
    throw InputError(input, "is empty, expected an image or a video");
  if (fs::is_regular_file(input)) refuse_dicom(input);
  if (has_image_extension(input) || has_unread_extension(input))
    return std::make_unique<PictureSource>(Kind::image, Pictures{{{input}}}, folder_fps);
  if (!fs::is_regular_file(input)) throw InputError(input, "is no file, expected an image, a folder or a video");
  return open_video(input, Kind::video, reading);
}

}  // namespace lapservo
