#include "lapservo/vision/search/blob_walk.h"

#include <gtest/gtest.h>

namespace lapservo::internal::blob_walk_test {

constexpr double reach_px = 60;

Blob blob_at(int u, int v) {
  return {{{u - 8, v, 1}, {u + 8, v, 2}}};
}

TEST(BlobWalk, GoesOnByPlaceWhereTheOrderChanges) {
  BlobWalk walk;
  const std::vector<Blob> first{blob_at(100, 100), blob_at(300, 100), blob_at(500, 100)};
  ASSERT_EQ(walk.rest(first, reach_px).size(), 3U);
  walk.finish(first[0]);
  walk.stop(first[1], 1);
  const std::vector<Blob> second{blob_at(520, 100), blob_at(120, 110), blob_at(310, 90)};
  const std::vector<const Blob*> rest = walk.rest(second, reach_px);
  EXPECT_EQ(rest, (std::vector{&second[2], &second[0]}));
  EXPECT_EQ(walk.start(), 1U);
  walk.finish(second[2]);
  EXPECT_EQ(walk.start(), 0U);
}

TEST(BlobWalk, FollowsWhatItLookedAtOnlySoFar) {
  BlobWalk walk;
  for (int u = 100; u <= 400; u += 50) {
    const std::vector<Blob> blobs{blob_at(u, 100)};
    EXPECT_EQ(walk.rest(blobs, reach_px).empty(), u != 100);
    if (u == 100) walk.finish(blobs[0]);
  }
  EXPECT_EQ(walk.rest({blob_at(500, 100)}, reach_px).size(), 1U);
}

TEST(BlobWalk, OfTwoBlobsInOnePlaceOneIsNew) {
  BlobWalk walk;
  walk.finish(blob_at(100, 100));
  const std::vector<Blob> blobs{blob_at(130, 100), blob_at(110, 100)};
  EXPECT_EQ(walk.rest(blobs, reach_px), std::vector{&blobs[0]});
}

TEST(BlobWalk, BeginsAnewWhereTheBlobItStoppedInIsGone) {
  BlobWalk walk;
  walk.stop(blob_at(100, 100), 1);
  EXPECT_TRUE(walk.begun());
  const std::vector<Blob> blobs{blob_at(300, 100)};
  EXPECT_EQ(walk.rest(blobs, reach_px), std::vector{&blobs[0]});
  EXPECT_EQ(walk.start(), 0U);
}

}  // namespace lapservo::internal::blob_walk_test
