#include "lapservo/io/image_file.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/io/pictures/png_picture.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/videos.h"

namespace lapservo::internal::image_file_test {
using Bytes = std::vector<std::uint8_t>;
using testing::input_error;
using testing::TemporaryFolder;

constexpr std::uint64_t seed = 61;
constexpr auto not_decoded = "p: can't be decoded, expected a PNG, JPEG, BMP, WebP, PPM or PGM image";

template <typename Value>
cv::Mat random_image(int rows, int columns, int type, Random& random) {
  cv::Mat image(rows, columns, type);
  for (int v = 0; v < rows; ++v)
    for (int i = 0; i < columns * image.channels(); ++i) image.ptr<Value>(v)[i] = static_cast<Value>(random.bits());
  return image;
}

Bytes encoded(const cv::Mat& image, const std::string& extension) {
  return extension == ".jpg" ? encode_jpeg(image) : encode_png(image);
}

std::string refusal(std::span<const std::uint8_t> bytes) {
  return input_error([&] { decode_image(bytes, "p"); });
}

// Grey is repeated over the channels, alpha dropped and not multiplied, 16 bits are rounded to 8.
TEST(Image, OfAnyKindOfPixelsIsBgrOfEightBits) {
  Random random(seed);
  for (const int type : {CV_8UC1, CV_8UC3, CV_8UC4, CV_16UC1, CV_16UC3, CV_16UC4}) {
    const bool deep = CV_MAT_DEPTH(type) == CV_16U;
    const cv::Mat image =
        deep ? random_image<std::uint16_t>(20, 20, type, random) : random_image<std::uint8_t>(20, 20, type, random);
    const cv::Mat bgr = decode_image(encoded(image, ".png"), "p");
    ASSERT_EQ(bgr.type(), CV_8UC3);
    for (int channel = 0; channel < 3; ++channel) {
      cv::Mat found, expected;
      cv::extractChannel(bgr, found, channel);
      cv::extractChannel(image, expected, image.channels() == 1 ? 0 : channel);
      found.convertTo(found, CV_64F), expected.convertTo(expected, CV_64F, deep ? 1 / 257.0 : 1);
      EXPECT_LE(cv::norm(found, expected, cv::NORM_INF), deep ? 0.5001 : 0) << type << " seed " << seed;
    }
  }
}

// The camera's calibration may be in either orientation.
TEST(Image, ThatExifWouldTurnIsRefused) {
  const cv::Mat wide(16, 48, CV_8UC3, cv::Scalar(20, 120, 220));
  const Bytes plain = encoded(wide, ".jpg");
  for (const std::uint8_t orientation : {0, 1, 2, 3, 6, 8, 9}) {
    Bytes jpeg = plain;
    // APP1 after the start marker: TIFF, one entry, orientation (0x0112).
    const Bytes exif{0xff, 0xe1, 0,    34,   'E', 'x', 'i', 'f', 0, 0, 'M', 'M',         0, 42, 0, 0, 0, 8,
                     0,    1,    0x01, 0x12, 0,   3,   0,   0,   0, 1, 0,   orientation, 0, 0,  0, 0, 0, 0};
    jpeg.insert(jpeg.begin() + 2, exif.begin(), exif.end());
    if (orientation < 2 || orientation > 8)
      EXPECT_EQ(decode_image(jpeg, "p").size(), wide.size());
    else
      EXPECT_EQ(refusal(jpeg), "p: EXIF orientation: is " + std::to_string(orientation) +
                                   ", expected 1: the pixels as the calibrated camera has them, not to be turned");
  }
}

// An image with smooth shades, as cameras see, so that a flipped bit matters.
cv::Mat shades() {
  cv::Mat image(120, 160, CV_8UC3);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      image.at<cv::Vec3b>(v, u) = cv::Vec3b(static_cast<std::uint8_t>(u + 20), static_cast<std::uint8_t>(2 * v),
                                            static_cast<std::uint8_t>((u * v) >> 7));
  return image;
}

TEST(Image, ThatItsDecoderComplainsOfIsDamaged) {
  const Bytes jpeg = encoded(shades(), ".jpg");
  EXPECT_FALSE(decode_picture(jpeg, "p").flaw);
  Bytes shortened = jpeg;  // the last quarter of the scan is gone, but the end marker is there
  shortened.erase(shortened.end() - static_cast<std::ptrdiff_t>(jpeg.size() / 4), shortened.end() - 2);
  EXPECT_EQ(decode_picture(shortened, "p").flaw, Status::damaged);
  EXPECT_EQ(refusal(shortened), "p: is damaged, expected a whole image");
}

// Every byte of a PNG is under a checksum.
TEST(Image, AnyChangedBitOfAPngIsNoticed) {
  Random random(seed);
  const Bytes png = encoded(shades(), ".png");
  EXPECT_FALSE(decode_picture(png, "p").flaw);
  for (int i = 0; i < 300; ++i) {
    Bytes changed = png;
    const std::size_t at = 8 + random.bits() % (png.size() - 8 - 12);
    changed[at] ^= static_cast<std::uint8_t>(1U << random.bits() % 8);
    bool noticed = false;
    try {
      noticed = decode_picture(changed, "p").flaw == Status::damaged;
    } catch (const InputError&) {
      noticed = true;
    }
    EXPECT_TRUE(noticed) << "byte " << at << " of " << png.size() << ", seed " << seed;
  }
}

TEST(Image, IsRefusedWhereverTheFileIsCut) {
  Random random(seed);
  const cv::Mat image = random_image<std::uint8_t>(12, 12, CV_8UC3, random);
  // The signature of the format; and a PNG's last checksum or a JPEG's end marker, without which the image is whole.
  struct Format {
    std::string extension, name;
    std::size_t signature, dispensable;
  };
  for (const Format& format : {Format{".png", "PNG", 8, 4}, Format{".jpg", "JPEG", 2, 2}}) {
    const Bytes whole = encoded(image, format.extension);
    EXPECT_EQ(refusal(whole), "");
    for (std::size_t size = 1; size < whole.size() - format.dispensable; ++size)
      EXPECT_EQ(refusal(std::span(whole).first(size)),
                size < format.signature ? not_decoded : "p: is a truncated " + format.name + ", expected a whole image")
          << size << " of " << whole.size() << " bytes";
  }
}

Bytes bytes_of(const std::string& text) {
  return {text.begin(), text.end()};
}

TEST(Image, OfAFormatThatIsNotReadIsNamed) {
  EXPECT_EQ(refusal(bytes_of("frame,time_s\n0,0\n")), not_decoded);
  EXPECT_EQ(refusal({}), "p: is empty, expected an image");
  EXPECT_EQ(input_error([] { bgr8_from(cv::Mat(4, 4, CV_8UC2, cv::Scalar(1, 2)), "p"); }),
            "p: channels: is 2, expected 1 (grey), 3 or 4 (alpha)");
  EXPECT_EQ(refusal(bytes_of(std::string("\0\0\0\x18", 4) + "ftypheic" + std::string(40, '\0'))),
            "p: is in HEIC, which is not read: convert it to PNG");
  for (const Bytes& tiff : {Bytes{'I', 'I', '*', 0, 8, 0}, Bytes{'M', 'M', 0, '*', 0, 0}})
    EXPECT_EQ(refusal(tiff), "p: is in TIFF, which is not read: convert it to PNG");
  Bytes jpeg = encoded(cv::Mat(16, 16, CV_8UC3, cv::Scalar(20, 120, 220)), ".jpg");
  const Bytes frame_header{0xff, 0xc0};
  const auto at = std::search(jpeg.begin(), jpeg.end(), frame_header.begin(), frame_header.end());
  ASSERT_NE(at, jpeg.end());
  at[9] = 4;
  EXPECT_EQ(refusal(jpeg), "p: is a JPEG in CMYK, which is not read: convert it to PNG in RGB");
}

// Each of a palette's colours stands for many: edges between two are not where the light's were.
TEST(Image, OfAPaletteOrOfFewBitsAChannelIsRefused) {
  const std::string remedy =
      ", expected the camera's colours, of 5 bits a channel or more: record or export it again in true colour, as a "
      "conversion does not restore them";
  Bytes png = encoded(shades(), ".png");
  png[25] = 3;  // of indices
  EXPECT_EQ(refusal(png), "p: has a palette" + remedy);
  png[24] = 4, png[25] = 0;
  EXPECT_EQ(refusal(png), "p: has 4 bits a channel" + remedy);
  EXPECT_EQ(refusal(bytes_of("P4\n8 1\n\xff")), "p: has 1 bits a channel" + remedy);
}

Bytes joined(const std::vector<Bytes>& parts) {
  Bytes all;
  for (const Bytes& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

TEST(Image, OfSeveralPicturesInOneFileIsRefusedAndCounted) {
  Random random(seed);
  const cv::Mat image = random_image<std::uint8_t>(5, 7, CV_8UC3, random);
  const Bytes png = encoded(image, ".png"), jpeg = encoded(image, ".jpg");
  const std::string pixels(std::size_t{3} * 5 * 7, 'P');
  const Bytes ppm = bytes_of("P6 # by hand\n7 5 255\n" + pixels), pgm = bytes_of("P5\n7 5\n255\n" + pixels.substr(70));
  const Bytes deep = bytes_of("P6\n7 5\n65535\n" + pixels + pixels), text = bytes_of("P3\n1 1\n255\n1 2 3\n");
  Bytes bmp = bytes_of(std::string("BM\x4a\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\1\0\0\0\5\0\0\0\1\0\x18\0", 30));
  bmp.resize(74);
  // A thumbnail within a segment, bytes behind the end, and a second image that MPF names do not count.
  Bytes with_thumbnail = jpeg, with_mpf = jpeg;
  const Bytes segment = joined({{0xff, 0xe1, 0, 8}, {0xff, 0xd9, 0xff, 0xd8, 0xff, 0xd9}});
  with_thumbnail.insert(with_thumbnail.begin() + 2, segment.begin(), segment.end());
  const Bytes mpf{0xff, 0xe2, 0, 6, 'M', 'P', 'F', 0};
  with_mpf.insert(with_mpf.begin() + 2, mpf.begin(), mpf.end());
  for (const Bytes& single : {png, jpeg, ppm, pgm, deep, text, bmp, with_thumbnail, joined({with_mpf, jpeg}),
                              joined({png, bytes_of("\n")}), joined({jpeg, Bytes(16, 0), bytes_of("SEFT")})})
    EXPECT_EQ(refusal(single), "") << std::string(single.begin(), single.begin() + 2);
  for (const Bytes& one : {png, jpeg, ppm, pgm, deep, text, bmp})
    for (const Bytes& between : {Bytes{}, Bytes(3, 0)}) {
      if (one == ppm && !between.empty()) continue;  // netpbm's have nothing between them
      EXPECT_EQ(refusal(joined({one, between, one, between, one})),
                "p: holds 3 images, expected one: write them into a folder, one a file")
          << std::string(one.begin(), one.begin() + 2);
    }
}

TEST(Image, ThatIsAnAnimationIsRefusedAndCounted) {
  const TemporaryFolder folder;
  for (const auto& [name, format] : {std::pair{"a.png", "apng"}, {"a.webp", "webp"}}) {
    const auto path = folder / name;
    if (!testing::ffmpeg("-f lavfi -i testsrc=s=64x48:r=25 -frames:v 5 -f " + std::string(format) + " '" +
                         path.string() + "'"))
      GTEST_SKIP() << "FFmpeg here can't write " << name;
    EXPECT_NE(input_error([&] { read_picture(path); }).find("holds 5 images, expected one"), std::string::npos);
  }
}

// A file of some bytes must not ask for gigabytes.
TEST(Image, IsRefusedWhenItClaimsToBeEnormous) {
  Bytes png = encoded(cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(7)), ".png");
  png[17] = 1;  // the width's second byte: 65540
  EXPECT_EQ(refusal(png), "p: size: is 65540x4, expected at most 16384 pixels a side");

  // An application segment whose contents look like a frame header, and garbage behind it, hide nothing.
  Bytes jpeg = encoded(cv::Mat(4, 4, CV_8UC3, cv::Scalar::all(7)), ".jpg");
  const Bytes application{0xff, 0xe5, 0, 11, 0xff, 0xc0, 0, 8, 8, 255, 255, 255, 255, 0x12, 0x34};
  jpeg.insert(jpeg.begin() + 2, application.begin(), application.end());
  EXPECT_EQ(refusal(jpeg), "p: is damaged, expected a whole image");
  for (const std::uint8_t frame : {0xc0, 0xc1, 0xc2}) {
    Bytes huge = jpeg;
    const Bytes baseline{0xff, 0xc0, 0, 17};
    const auto at = std::search(huge.begin(), huge.end(), baseline.begin(), baseline.end());
    ASSERT_NE(at, huge.end());
    at[1] = frame, at[7] = 0xff, at[8] = 0xf0;
    EXPECT_EQ(refusal(huge), "p: size: is 65520x4, expected at most 16384 pixels a side");
  }
}

TEST(Image, ThatCanNotBeWrittenIsNamedAndLeavesNothing) {
  const TemporaryFolder folder;
  const cv::Mat image(4, 4, CV_8UC3, cv::Scalar::all(7));
  std::filesystem::create_directory(folder / "taken.png");
  const auto said = [&](const char* name) { return input_error([&] { write_image(folder / name, image); }); };
  const std::string place = folder.path().string() + "/";
  for (const std::string name : {"a.tif", "a.xyz", "a"})
    EXPECT_EQ(said(name.c_str()),
              place + name + ": can't be written as an image, expected a name that ends in .png or .jpg");
  EXPECT_EQ(said("none/a.png"), place + "none/a.png: can't be written: No such file or directory");
  EXPECT_EQ(said("taken.png"), place + "taken.png: is a folder, expected a file to write");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1) << "nothing but the folder";
}

TEST(HasImageExtension, GoesByTheNamesEndInAnyCase) {
  for (const char* name : {"a.png", "a.PNG", "dir.x/a.jpeg", "a.jpg", "a.bmp", "a.webp", "a.ppm"})
    EXPECT_TRUE(has_image_extension(name)) << name;
  for (const char* name : {"a", "png", ".png", "a.mp4", "a.png.txt", "a.pngx", "a.tif", "dir.png/a", ""})
    EXPECT_FALSE(has_image_extension(name)) << name;
}

}  // namespace lapservo::internal::image_file_test
