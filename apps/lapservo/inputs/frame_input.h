#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lapservo/cli/subcommands.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/io/frame_source.h"

namespace lapservo::app {

/// How a command reads its frames.
struct FrameOptions {
  std::string image_topic;   ///< of a bag: see internal::image_topic_of(); of a session: the stream
  std::string eye;           ///< left or right, where both are side by side in each frame; else empty
  std::string side_by_side;  ///< LR or RL; empty: as a session says, else LR
  static constexpr double usual_fps = 30;
  std::optional<double> fps;  ///< of a folder of images; else usual_fps
  bool deinterlace = false;   ///< one field of each frame is tracked; also where the rig's camera says so
  std::string colour_matrix, chroma_location;  ///< see VideoReading
};

/// internal::open_camera_or_file() until Ctrl-C, and the images of bags and of sessions of dvrk_data, of one eye where
/// the options name it. Says the source's remark on stderr, and which options it ignores. `camera`: the rig's, whose
/// size a camera's images shall have; null where none is known.
std::unique_ptr<FrameSource> open_frames(const std::string& input, const FrameOptions& options, const Camera* camera);

/// Says it on stderr, once, where there is something to say.
void say_remark(const std::string& input, const std::string& remark);

/// Says on stderr when a topic's name (image_rect, image_rect_color) is that of undistorted images, which do not go
/// with a camera that distorts. `camera`: the rig's, or null.
void say_if_undistorted(const std::string& topic, const Camera* camera);

/// Throws InputError naming `option` where it names a topic although `input` is no bag.
void refuse_topic_outside_bags(const std::string& option, const std::string& topic, const std::string& input);

void add_image_topic_option(Command command, std::string& image_topic);

/// --eye and --side-by-side.
void add_eye_options(Command command, FrameOptions& options);

/// Those, --colour-matrix and --chroma-location.
void add_video_options(Command command, FrameOptions& options);

/// All that say how a recording's frames are read.
std::vector<std::string> frame_option_names();

}  // namespace lapservo::app
