#pragma once

#include <memory>
#include <string>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// Whether a folder is a session of dvrk_data: videos, each beside a JSON with the times of its frames, a ROS 2 bag,
/// and an index.json (dvrk_data:index@1.0.0) that names them.
bool is_session(const std::string& path);

/// Its bag; empty where it has none.
std::string bag_of_session(const std::string& folder);

struct SessionVideo {
  std::unique_ptr<FrameSource> frames;
  std::string layout;  ///< "LR" or "RL" where both eyes are side by side; else empty
};

/// The frames of a session's video stream, by the realtime clock of the computer that recorded it, as dvrk_data's own
/// tools take it from what each frame's record has: the source's time, the middle between those of the left and the
/// right one, either of them, or the time of arrival at the recorder. The first of these that any frame has counts for
/// all; a frame without it has another one less their median difference. `stream`: its name; empty: the only one.
/// Throws InputError where none or several remain, and for damaged files.
SessionVideo open_session(const std::string& folder, const std::string& stream, const VideoReading& reading);

}  // namespace lapservo::internal
