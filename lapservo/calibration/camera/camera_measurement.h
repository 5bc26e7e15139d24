#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/camera/camera_calibration.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/spread.h"
#include "lapservo/vision/image/interlacing.h"

namespace lapservo::internal {

/// A board of `square_m` described by words: "9x6" inner corners; for a ChArUco board its dictionary, and a marker's
/// width, else 3/4 of a square's. Throws InputError naming `names` for what is none.
struct BoardWords {
  std::string corners;
  double square_m = 0;
  std::string dictionary{};
  std::optional<double> marker_m{};

  /// How the user calls them.
  struct Names {
    std::string board = "--board", marker = "--marker-mm", dictionary = "--aruco";
  };
};
Board board_of(const BoardWords& words, const BoardWords::Names& names = {});

/// Gathers views of a board: every image of folders; of videos and cameras those that differ, of four frames a second
/// or fewer.
class BoardRecordings {
 public:
  /// `rig`: its camera took them and gives their size; else the first one does. `deinterlace`: the field of the even
  /// rows, whatever the rig says. Throws InputError for a board of fewer corners than a view needs.
  BoardRecordings(const Board& board, std::size_t most_views, const std::optional<Rig>& rig, bool deinterlace = false);

  /// Gathers views of a live camera until they suffice; `say` receives advice for the next view. Throws InputError at
  /// an image of another size.
  void look_at(FrameSource& source, const std::string& name, const JobWatch& watch,
               const std::function<void(const std::string&)>& say = {});

  const FramesRead& read() const { return read_; }
  const std::vector<std::string>& without_board() const { return without_board_; }
  /// Size of the images; nullopt before the first one, where no rig gives it.
  const std::optional<cv::Size>& size() const { return size_; }
  /// One line on the chessboard of another size that most of some images without the board show; else empty.
  std::string other_board() const;
  /// Those chosen; empties this.
  std::vector<BoardView> take_views() { return views_.take(); }

 private:
  Board board_;
  BoardViews views_;
  std::optional<EvenField> field_;  // where images are interlaced
  std::optional<cv::Size> size_;
  std::string whose_;
  FramesRead read_;
  std::vector<std::string> without_board_;
  Spread<cv::Mat> others_{4};  // images without the board
};

/// Calibrates by what was gathered.
CameraCalibration measure_camera(const Board& board, BoardRecordings recordings, const Camera& start,
                                 const JobWatch& watch);

/// The camera with its sigmas and covariance to the digits of a rig's file, and the response's sigma.
Camera measured_camera(const CameraCalibration& calibration);

/// Each number of the camera, in its units; `before` is that of the camera that was started with.
std::vector<CalibratedNumber> calibrated_numbers(const Camera& before, const CameraCalibration& calibration);

}  // namespace lapservo::internal
