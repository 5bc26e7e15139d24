#pragma once

#include <memory>
#include <string>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// Which part of a frame that shows both eyes of an endoscope side by side.
enum class Half { left, right };

/// One half of each frame. `name`: of the source, for messages. Its frames throw InputError where their width is odd.
std::unique_ptr<FrameSource> half_frames(std::unique_ptr<FrameSource> source, Half half, const std::string& name);

}  // namespace lapservo::internal
