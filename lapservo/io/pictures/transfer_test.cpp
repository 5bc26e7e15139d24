// Patches of known light through files that name how they encode it.
#include "lapservo/io/pictures/transfer.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>
#include <zlib.h>

#include <gtest/gtest.h>

#include "lapservo/geometry/response.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/pictures/png_picture.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::transfer_test {
using testing::expect_patches;

using Encoding = std::function<double(double)>;

// By the standards' formulas from light to value; light 1 is white.
double hlg(double light) {
  const double e = 0.26496256 * light;
  return e <= 1 / 12.0 ? std::sqrt(3 * e) : 0.17883277 * std::log(12 * e - 0.28466892) + 0.55991073;
}
double pq(double light) {
  const double y = std::pow(203 * light / 10000, 0.1593017578125);
  return std::pow((0.8359375 + 18.8515625 * y) / (1 + 18.6875 * y), 78.84375);
}
double linear(double light) {
  return light;
}
Encoding power(double gamma) {
  return [gamma](double light) { return std::pow(light, 1 / gamma); };
}

const std::array<cv::Vec3b, 5> patches{
    cv::Vec3b{30, 40, 200}, {60, 180, 50}, {210, 90, 40}, {128, 128, 128}, {250, 250, 250}};

cv::Mat srgb_patches() {
  return testing::patches_of(patches, 128);
}

// The same light, encoded in 16 bits.
cv::Mat encoded(const Encoding& encoding) {
  const cv::Mat srgb = srgb_patches();
  cv::Mat bgr(srgb.size(), CV_16UC3);
  for (int v = 0; v < bgr.rows; ++v)
    for (int i = 0; i < 3 * bgr.cols; ++i)
      bgr.ptr<std::uint16_t>(v)[i] = static_cast<std::uint16_t>(
          std::lround(65535 * encoding(Response().light_from_value(srgb.ptr(v)[i] / 255.0))));
  return bgr;
}

TEST(Transfer, OfAVideoIsUndone) {
  const testing::TemporaryFolder folder;
  struct Video {
    const char *tag, *name;
    Encoding encoding;
  };
  int written = 0;
  for (const Video& video :
       {Video{"arib-std-b67", "HLG", hlg}, Video{"smpte2084", "PQ", pq}, Video{"linear", "linear light", linear}})
    for (const char* coding : {"-c:v libx265 -x265-params lossless=1:log-level=-1 -pix_fmt yuv444p10le",
                               "-c:v libx264 -qp 0 -pix_fmt yuv444p10le", "-c:v ffv1 -pix_fmt yuv422p10le",
                               "-c:v ffv1 -pix_fmt gbrp16le", "-c:v prores_ks -profile:v 4444 -pix_fmt yuv444p10le"}) {
      const std::string text = coding,
                        path = (folder / (text.find("prores") == text.npos ? "a.mkv" : "a.mov")).string();
      const std::string matrix = text.find("gbrp") == text.npos ? "bt2020nc" : "rgb";
      const std::string scale = matrix == "rgb" ? "" : "scale=out_color_matrix=bt2020:out_range=tv:flags=accurate_rnd,";
      if (!testing::write_by_ffmpeg(path, encoded(video.encoding),
                                    "-vf " + scale + "setparams=color_trc=" + video.tag +
                                        (matrix == "rgb" ? "" : ":colorspace=bt2020nc") + " " + coding +
                                        " -colorspace " + matrix + " -color_trc " + video.tag +
                                        " -color_primaries bt2020 -color_range " + (matrix == "rgb" ? "pc" : "tv")))
        continue;
      ++written;
      if (text.find("prores") != text.npos && std::string(video.tag) == "linear") continue;  // it has no code for that
      SCOPED_TRACE(std::string(video.tag) + " " + coding);
      if (text.find("422") != text.npos && std::string(video.name) != "HLG") {
        const std::string refused = testing::input_error([&] { open_frame_source(path, 25); });
        const std::string said =
            std::string("transfer: is ") + video.tag + ", expected bt709 or HLG, or chroma of full size";
        EXPECT_NE(refused.find(said), std::string::npos) << refused;
        continue;
      }
      const auto source = open_frame_source(path, 25);
      EXPECT_TRUE(source->is_srgb());
      EXPECT_EQ(source->remark(), std::string("names ") + video.name + ": its light is read as sRGB");
      const auto frame = source->next();
      ASSERT_TRUE(frame && frame->is_srgb && frame->deinterlaced == false);
      expect_patches(frame->bgr, patches, video.encoding(0.01) == 0.01 ? 4 : 2);  // linear values of 10 bits are coarse
    }
  if (written == 0) GTEST_SKIP() << "no ffmpeg";
}

TEST(Transfer, OfCamerasIsTheRigsAndOthersAreRefused) {
  const testing::TemporaryFolder folder;
  const std::string path = (folder / "a.mkv").string();
  const auto write = [&](const char* tag) {
    return testing::write_by_ffmpeg(path, srgb_patches(),
                                    std::string("-vf scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd -c:v "
                                                "ffv1 -pix_fmt yuv444p -colorspace bt709 -color_range tv -color_trc ") +
                                        tag);
  };
  for (const char* tag : {"bt709", "iec61966-2-1", "smpte170m", "bt2020-10", "gamma22", "gamma28", "unknown"}) {
    if (!write(tag)) GTEST_SKIP() << "no ffmpeg";
    const auto source = open_frame_source(path, 25);
    EXPECT_FALSE(source->is_srgb()) << tag;
    EXPECT_EQ(source->remark(), "") << tag;
    expect_patches(source->next()->bgr, patches, 2);
  }
  for (const char* tag : {"log100", "log316", "smpte428"}) {
    ASSERT_TRUE(write(tag));
    const std::string said = testing::input_error([&] { open_frame_source(path, 25); });
    EXPECT_NE(said.find("transfer: is "), std::string::npos) << said;
    EXPECT_NE(said.find("zscale=transfer=bt709"), std::string::npos) << said;
  }
}

std::vector<std::uint8_t> big_endian(std::uint32_t value) {
  std::vector<std::uint8_t> bytes;
  for (const int shift : {24, 16, 8, 0}) bytes.push_back(static_cast<std::uint8_t>(value >> shift));
  return bytes;
}

// A chunk after a PNG's header.
std::vector<std::uint8_t> with_chunk(std::vector<std::uint8_t> png, const std::string& name,
                                     const std::vector<std::uint8_t>& content) {
  std::vector<std::uint8_t> chunk(name.begin(), name.end());
  chunk.insert(chunk.end(), content.begin(), content.end());
  const auto sum = big_endian(static_cast<std::uint32_t>(crc32(0, chunk.data(), static_cast<uInt>(chunk.size()))));
  auto whole = big_endian(static_cast<std::uint32_t>(content.size()));
  for (const auto& part : {chunk, sum}) whole.insert(whole.end(), part.begin(), part.end());
  constexpr std::ptrdiff_t header = 33;
  png.insert(png.begin() + header, whole.begin(), whole.end());
  return png;
}

std::vector<std::uint8_t> gamma_chunk(double gamma) {
  return big_endian(static_cast<std::uint32_t>(std::lround(1e5 / gamma)));
}

TEST(Transfer, OfAPngIsUndone) {
  const testing::TemporaryFolder folder;
  struct Png {
    Encoding encoding;
    std::string chunk;
    std::vector<std::uint8_t> content;
    std::string name;
  };
  for (const Png& png :
       {Png{linear, "gAMA", gamma_chunk(1), "linear light"}, Png{power(1.8), "gAMA", gamma_chunk(1.8), "gamma 1.80"},
        Png{power(2.6), "gAMA", gamma_chunk(2.6), "gamma 2.60"}, Png{hlg, "cICP", {9, 18, 0, 1}, "HLG"},
        Png{pq, "cICP", {9, 16, 0, 1}, "PQ"}, Png{linear, "cICP", {1, 8, 0, 1}, "linear light"}}) {
    const auto bytes = with_chunk(encode_png(encoded(png.encoding)), png.chunk, png.content);
    expect_patches(decode_image(bytes, "p"), patches, 1);
    testing::write_file(folder / "a.png", {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    const auto source = open_frame_source(folder.path().string(), 25);
    EXPECT_EQ(source->remark(), "names " + png.name + ": its light is read as sRGB");
    EXPECT_TRUE(source->is_srgb() && source->next()->is_srgb);
  }
}

TEST(Transfer, OfALaterImageIsThatOfTheFirst) {
  const testing::TemporaryFolder folder;
  const auto plain = encode_png(srgb_patches());
  const auto refused = [&](const std::vector<std::uint8_t>& later) {
    const auto first = with_chunk(plain, "gAMA", gamma_chunk(1.8));
    testing::write_file(folder / "1.png", {reinterpret_cast<const char*>(first.data()), first.size()});
    testing::write_file(folder / "2.png", {reinterpret_cast<const char*>(later.data()), later.size()});
    const auto source = open_frame_source(folder.path().string(), 25);
    EXPECT_TRUE(source->next());
    return testing::input_error([&] { source->next(); });
  };
  EXPECT_EQ(refused(with_chunk(plain, "gAMA", gamma_chunk(1.8))), "");
  EXPECT_NE(refused(plain).find("2.png: transfer: is a camera's, expected gamma 1.80 as in 1.png"), std::string::npos);
  EXPECT_NE(refused(with_chunk(plain, "cICP", {9, 18, 0, 1})).find("is HLG, expected gamma 1.80"), std::string::npos);
}

TEST(Transfer, OfAPngThatSaysWhatCamerasDoIsTheRigs) {
  const auto plain = encode_png(srgb_patches());
  for (const auto& bytes : {with_chunk(plain, "gAMA", gamma_chunk(2.2)), with_chunk(plain, "gAMA", {0, 0, 0, 0}),
                            with_chunk(with_chunk(plain, "gAMA", gamma_chunk(1)), "sRGB", {0}),
                            with_chunk(plain, "cICP", {1, 13, 0, 1}), with_chunk(plain, "cICP", {1, 1, 0, 1})})
    expect_patches(decode_image(bytes, "p"), patches, 0);
}

}  // namespace lapservo::internal::transfer_test
