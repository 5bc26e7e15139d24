#include "lapservo/crtk/image_receiver.h"

#include <gtest/gtest.h>

namespace lapservo::internal::image_receiver_test {

constexpr double epoch_s = 1.7e9, period_s = 1.0 / 30;

ImageMessage image(double stamp_s, std::uint32_t width = 4, std::uint32_t height = 2) {
  ImageMessage message;
  message.stamp_s = stamp_s;
  message.width = width, message.height = height, message.step = 3 * width;
  message.encoding = "bgr8";
  message.data.assign(std::size_t{message.step} * height, 9);
  return message;
}

TEST(ImageReceiver, GivesTheNewestOnceAndCountsTheRest) {
  ImageReceiver receiver(4, 2);
  EXPECT_FALSE(receiver.newest());
  receiver.receive(image(epoch_s), 5);
  const auto first = receiver.newest();
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->time_s, 5, 1e-6);
  EXPECT_FALSE(receiver.newest());
  for (int k = 1; k < 4; ++k) receiver.receive(image(epoch_s + k * period_s), 5 + k * period_s);
  EXPECT_NEAR(receiver.newest()->time_s, 5 + 3 * period_s, 1e-6);
  EXPECT_EQ(receiver.counts().taken, 2);
  EXPECT_EQ(receiver.counts().skipped, 2);
  EXPECT_EQ(receiver.counts().text(), "skipped 2");
}

TEST(ImageReceiver, StampsByTheLoopsClockStay) {
  ImageReceiver receiver(4, 2, StampsBy::loop);
  receiver.receive(image(5), 5.01);
  EXPECT_DOUBLE_EQ(receiver.newest()->time_s, 5);
  receiver.receive(image(5.03), 5.08);
  EXPECT_DOUBLE_EQ(receiver.newest()->time_s, 5.03);
  receiver.receive(image(5.12), 5.11);  // not after it came
  EXPECT_DOUBLE_EQ(receiver.newest()->time_s, 5.11);
}

TEST(ImageReceiver, DropsAndCountsWhatCanNotBeUsed) {
  ImageReceiver receiver(4, 2);
  double now_s = 5;
  const auto offer = [&](ImageMessage message) {
    now_s += period_s;
    receiver.receive(std::move(message), now_s);
    return receiver.newest().has_value();
  };
  EXPECT_TRUE(offer(image(epoch_s + now_s)));
  EXPECT_FALSE(offer(image(epoch_s + now_s, 6, 2)));
  EXPECT_EQ(receiver.complaint(), "size 6x2, expected 4x2 as in the rig");
  ImageMessage grey = image(epoch_s + now_s);
  grey.encoding = "mono8";
  EXPECT_FALSE(offer(grey));
  EXPECT_NE(receiver.complaint().find("mono8"), std::string::npos);
  EXPECT_FALSE(offer(image(std::nan(""))));
  EXPECT_FALSE(offer(image(0)));
  EXPECT_FALSE(offer(image(epoch_s + now_s + 3600)));
  EXPECT_TRUE(offer(image(epoch_s + now_s + 3600)));
  EXPECT_FALSE(offer(image(epoch_s + now_s + 3600 - 2)));
  EXPECT_EQ(receiver.complaint(), "the same stamp again");
  CompressedImageMessage compressed;
  compressed.stamp_s = epoch_s + now_s + 3600;
  receiver.receive(std::move(compressed), now_s + period_s);
  EXPECT_FALSE(receiver.newest());
  const ImageCounts counts = receiver.counts();
  EXPECT_EQ(counts.taken, 2);
  EXPECT_EQ(counts.resized, 1);
  EXPECT_EQ(counts.unreadable, 2);
  EXPECT_EQ(counts.unstamped, 2);
  EXPECT_EQ(counts.repeated, 1);
  EXPECT_EQ(counts.jumped, 1);
}

// Two take turns, at 30 Hz each.
TEST(ImageReceiver, TheFirstSenderCountsUntilItIsSilent) {
  ImageReceiver receiver(4, 2);
  double now_s = 5;
  const auto offer = [&](std::uint64_t source, double after_s = period_s / 2) {
    now_s += after_s;
    ImageMessage message = image(epoch_s + now_s);
    message.source = source;
    receiver.receive(std::move(message), now_s);
    return receiver.newest().has_value();
  };
  EXPECT_TRUE(offer(7));
  EXPECT_FALSE(receiver.take_second_sender());
  for (int k = 0; k < 60; ++k) {
    EXPECT_FALSE(offer(8));
    EXPECT_EQ(receiver.take_second_sender(), k == 0);
    EXPECT_TRUE(offer(7));
  }
  EXPECT_EQ(receiver.counts().text(), "of another sender 60");
  EXPECT_EQ(receiver.complaint(), "two programs publish this camera's images");
  for (int k = 0; k < 60; ++k) EXPECT_TRUE(offer(7, period_s));
  EXPECT_FALSE(receiver.take_second_sender());
  EXPECT_FALSE(offer(8));
  EXPECT_TRUE(receiver.take_second_sender()) << "it was gone, and is back";
  EXPECT_FALSE(offer(8, 0.4));
  EXPECT_TRUE(offer(8, 0.11)) << "the first has been silent";
  EXPECT_TRUE(receiver.take_second_sender()) << "it took over";
  EXPECT_FALSE(offer(7));
  EXPECT_TRUE(receiver.take_second_sender());
  EXPECT_TRUE(offer(8));
  EXPECT_EQ(receiver.counts().missing, 0);
}

// A sender of useless images is there all the same.
TEST(ImageReceiver, WhoSendsCompressedImagesIsASenderAsWell) {
  ImageReceiver receiver(4, 2);
  CompressedImageMessage compressed;
  compressed.source = 8;
  receiver.receive(std::move(compressed), 5);
  ImageMessage other = image(epoch_s);
  other.source = 7;
  receiver.receive(std::move(other), 5.1);
  EXPECT_FALSE(receiver.newest());
  EXPECT_EQ(receiver.counts().text(), "without a stamp 1, of another sender 1");
  EXPECT_TRUE(receiver.take_second_sender());
}

TEST(ImageReceiver, CountsLateAndMissingFrames) {
  ImageReceiver receiver(4, 2);
  for (int k = 0; k < 30; ++k)
    if (k % 10 != 5 && k != 16) receiver.receive(image(epoch_s + k * period_s), 5 + k * period_s);
  EXPECT_EQ(receiver.counts().missing, 4);
  receiver.receive(image(epoch_s + 31 * period_s), 5 + 32 * period_s + 0.6);
  EXPECT_EQ(receiver.counts().late, 1);
}

}  // namespace lapservo::internal::image_receiver_test
