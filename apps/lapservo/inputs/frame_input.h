#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/cli/subcommands.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/io/frame_source.h"

namespace lapservo::app {

/// internal::open_camera_or_file() until Ctrl-C, and the images of bags; `image_topic`: see internal::image_topic_of().
/// `camera`: the rig's, whose size a camera's images shall have; null where none is known. `deinterlace`: one field of
/// each frame is tracked; also where the rig's camera says so.
std::unique_ptr<FrameSource> open_frames(const std::string& input, double folder_fps, const std::string& image_topic,
                                         const Camera* camera, bool deinterlace = false);

/// Throws InputError naming `option` where it names a topic although `input` is no bag.
void refuse_topic_outside_bags(const std::string& option, const std::string& topic, const std::string& input);

void add_image_topic_option(Command command, std::string& image_topic);

}  // namespace lapservo::app
