#pragma once

#include <memory>
#include <string>

#include "apps/lapservo/subcommands.h"
#include "lapservo/io/frame_source.h"

namespace lapservo::app {

/// open_frame_source(), and the images of bags; `image_topic`: see internal::image_topic_of().
std::unique_ptr<FrameSource> open_frames(const std::string& input, double folder_fps, const std::string& image_topic);

void add_image_topic_option(CLI::App* command, std::string& image_topic);

}  // namespace lapservo::app
