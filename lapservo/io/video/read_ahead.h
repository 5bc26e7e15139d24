#pragma once

#include <memory>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// The same frames, complaints and exceptions, read by a thread of its own while those before are looked at: a video's
/// decoding takes as long as the looking. It begins with the first next(), and stays a few frames ahead at most. Not
/// for live sources, whose frames are to be the newest. One thread asks.
std::unique_ptr<FrameSource> read_ahead(std::unique_ptr<FrameSource> source);

}  // namespace lapservo::internal
