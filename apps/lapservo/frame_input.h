#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/subcommands.h"
#include "lapservo/io/frame_source.h"

namespace lapservo::app {

/// open_frame_source(), and the images of bags; `image_topic`: see internal::image_topic_of().
std::unique_ptr<FrameSource> open_frames(const std::string& input, double folder_fps, const std::string& image_topic);

/// Throws InputError naming `option` where it names a topic although `input` is no bag.
void refuse_topic_outside_bags(const std::string& option, const std::string& topic, const std::string& input);

void add_image_topic_option(Command command, std::string& image_topic);

}  // namespace lapservo::app
