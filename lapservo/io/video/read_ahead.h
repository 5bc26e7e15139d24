#pragma once

#include <memory>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// The same frames, complaints and exceptions, read by a thread of its own while the previous ones are processed:
/// decoding a video takes as long as processing it. It begins with the first next(), and stays a few frames ahead at
/// most. Not for live sources, whose frames have to be the newest. For one calling thread.
std::unique_ptr<FrameSource> read_ahead(std::unique_ptr<FrameSource> source);

}  // namespace lapservo::internal
