#include "lapservo/vision/search/blob_walk.h"

#include <algorithm>

namespace lapservo::internal {
namespace {

Eigen::Vector2d middle_of(const Blob& blob) {
  Eigen::Vector2d sum(0, 0);
  for (const Blob::Sample& sample : blob.samples) sum += Eigen::Vector2d(sample.u, sample.v);
  return sum / static_cast<double>(std::max<std::size_t>(1, blob.samples.size()));
}

struct Pair {
  double distance_px;
  std::size_t place, blob;
};

// Each place with one blob at most, the nearest pairs first.
std::vector<Pair> pair_up(const std::vector<Eigen::Vector2d>& places_px, const std::vector<Eigen::Vector2d>& blobs_px,
                          double reach_px) {
  std::vector<Pair> all, pairs;
  for (std::size_t place = 0; place < places_px.size(); ++place)
    for (std::size_t blob = 0; blob < blobs_px.size(); ++blob) {
      const double distance_px = (places_px[place] - blobs_px[blob]).norm();
      if (distance_px < reach_px) all.push_back({distance_px, place, blob});
    }
  std::sort(all.begin(), all.end(), [](const Pair& a, const Pair& b) { return a.distance_px < b.distance_px; });
  for (const Pair& pair : all)
    if (std::ranges::none_of(pairs, [&](const Pair& p) { return p.place == pair.place || p.blob == pair.blob; }))
      pairs.push_back(pair);
  return pairs;
}

}  // namespace

// A place without a blob stays: the blob may be back in the next frame.
std::vector<const Blob*> BlobWalk::rest(const std::vector<Blob>& blobs, double reach_px) {
  std::vector<Eigen::Vector2d> places_px = looked_at_px_, blobs_px;
  if (stopped_in_px_) places_px.push_back(*stopped_in_px_);
  for (const Blob& blob : blobs) blobs_px.push_back(middle_of(blob));
  std::vector<bool> looked_at(blobs.size());
  const Blob* stopped_in = nullptr;
  for (const Pair& pair : pair_up(places_px, blobs_px, reach_px)) {
    looked_at[pair.blob] = true;
    if (pair.place < looked_at_px_.size())
      looked_at_px_[pair.place] = blobs_px[pair.blob];
    else
      stopped_in = &blobs[pair.blob];
  }
  std::vector<const Blob*> rest;
  if (stopped_in)
    rest.push_back(stopped_in);
  else
    stopped_in_px_.reset(), start_ = 0;
  for (std::size_t i = 0; i < blobs.size(); ++i)
    if (!looked_at[i]) rest.push_back(&blobs[i]);
  return rest;
}

void BlobWalk::stop(const Blob& blob, std::size_t next_start) {
  stopped_in_px_ = middle_of(blob), start_ = next_start;
}

void BlobWalk::finish(const Blob& blob) {
  looked_at_px_.push_back(middle_of(blob));
  stopped_in_px_.reset(), start_ = 0;
}

}  // namespace lapservo::internal
