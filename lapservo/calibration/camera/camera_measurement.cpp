#include "lapservo/calibration/camera/camera_measurement.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/core/rounded_covariance.h"
#include "lapservo/core/rounded_sigma.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t enough_live_views = 12;
// Searches four frames a second of a video, as a hand moves a board, and in a long one at least so many, and four for
// each view that is needed: the corners of 1280x720 take some 60 ms to find.
int every_of_video(const FrameSource& source, std::size_t most_views) {
  constexpr int enough_frames = 120;
  const int quarter_second = std::max(1, static_cast<int>(source.frames_per_second() / 4));
  return std::max(quarter_second, every_of(source, std::max(enough_frames, 4 * static_cast<int>(most_views))));
}

std::string name_of(const Frame& frame) {
  return frame.file.empty() ? fmt::format("frame {}", frame.index) : frame.file.string();
}

}  // namespace

Board board_of(const BoardWords& words, const BoardWords::Names& names) {
  Board board;
  const char* const end = words.corners.data() + words.corners.size();
  const auto [times, first] = std::from_chars(words.corners.data(), end, board.columns);
  bool read = first == std::errc() && times != end && (*times == 'x' || *times == 'X');
  if (read) {
    const auto [rest, second] = std::from_chars(times + 1, end, board.rows);
    read = second == std::errc() && rest == end;
  }
  const auto usual = [](int count) { return count >= 3 && count <= 50; };
  if (!read || !usual(board.columns) || !usual(board.rows))
    throw InputError(names.board, "corners", words.corners,
                     "COLUMNSxROWS of inner corners, 3 to 50 each, for example 9x6");
  board.square_m = words.square_m;
  board.dictionary = words.dictionary;
  if (words.dictionary.empty()) {
    if (words.marker_m)
      throw InputError(names.marker, "is of a ChArUco board, expected " + names.dictionary + " with it");
    return board;
  }
  constexpr double usual_share = 0.75;
  board.marker_m = words.marker_m.value_or(usual_share * board.square_m);
  if (board.marker_m >= board.square_m)
    throw InputError(names.marker, "width", fmt::format("{:.6g}", 1e3 * board.marker_m),
                     fmt::format("less than a square's {:.6g} mm", 1e3 * words.square_m));
  if (const std::string problem = board_problem(board); !problem.empty()) throw InputError(names.dictionary, problem);
  return board;
}

BoardRecordings::BoardRecordings(const Board& board, std::size_t most_views, const std::optional<Rig>& rig,
                                 bool deinterlace)
    : board_(board), views_(board, most_views), whose_("the rig's camera") {
  if (static_cast<std::size_t>(board.columns * board.rows) < BoardViews::least_corners)
    throw InputError("board", "inner corners", fmt::format("{}x{}", board.columns, board.rows),
                     fmt::format("{} or more to calibrate a camera", BoardViews::least_corners));
  if (rig) size_ = cv::Size(rig->camera.width_px, rig->camera.height_px);
  if (deinterlace || (rig && rig->camera.deinterlace)) field_.emplace(rig ? rig->camera.response : Response{});
}

void BoardRecordings::look_at(FrameSource& source, const std::string& name, const JobWatch& watch,
                              const std::function<void(const std::string&)>& say) {
  const bool pictures = source.kind() == FrameSource::Kind::image || source.kind() == FrameSource::Kind::folder;
  const bool live = source.kind() == FrameSource::Kind::live;
  const int every = pictures || live ? 1 : every_of_video(source, views_.most());
  std::string said;
  int read = 0;
  while (!(read_.stopped = watch.stopped())) {
    const auto frame = source.next();
    if (!frame) break;
    if (!size_) size_ = frame->bgr.size(), whose_ = name_of(*frame);
    check_frame_size(*frame, name, *size_, whose_);
    check_frame_reading(*frame, name, {}, field_.has_value());  // the response is measured
    if (read++ % every != 0) continue;
    if (frame->flaw) {
      ++read_.damaged;
      continue;
    }
    ++read_.looked_at;
    // The rest is still read, since it may be damaged, but no view would be taken of it.
    const bool searched = pictures || !views_.full();
    if (searched) {
      const cv::Mat bgr = field_ ? field_->of(frame->bgr).clone() : frame->bgr;
      if (!views_.add(name_of(*frame), bgr, pictures)) {
        others_.add([&] { return bgr.clone(); });
        if (pictures) without_board_.push_back(name_of(*frame));
      }
    }
    watch.tell(source.frame_count(), read, fmt::format(", {} views", views_.views().size()));
    if (!live) continue;
    const std::string wanted = views_.views().empty() ? "show the board" : advice(views_.views(), *size_);
    if (say && wanted != said) say(fmt::format("{} views: {}", views_.views().size(), wanted));
    said = wanted;
    if (views_.full() || (wanted.empty() && views_.views().size() >= enough_live_views)) break;
  }
  // A camera is stopped when there are enough views: that is how its calibration ends.
  if (live) read_.stopped = false;
  read_.complaint = read_.stopped ? "" : source.complaint();
}

std::string BoardRecordings::other_board() const {
  if (!board_.dictionary.empty()) return "";
  std::map<std::pair<int, int>, std::size_t> sizes;
  for (const cv::Mat& bgr : others_.items())
    if (const auto size = size_of_chessboard(bgr)) ++sizes[*size];
  for (const auto& [size, images] : sizes)
    if (2 * images > others_.items().size())
      return fmt::format(
          "{} of {} images that were tried show a chessboard of {}x{} inner corners (squares meet at them, the outer "
          "border has none): --board {}x{}, where it is in view wholly",
          images, others_.items().size(), size.first, size.second, size.first, size.second);
  return "";
}

CameraCalibration measure_camera(const Board& board, BoardRecordings recordings, const Camera& start,
                                 const JobWatch& watch) {
  CameraCalibration calibration;
  const FramesRead& read = recordings.read();
  if (read.stopped) return calibration.refusal = "stopped", calibration;
  std::vector<BoardView> views = recordings.take_views();
  if (views.empty()) {
    if (read.all_damaged()) return calibration.refusal = text_of_damaged(read.damaged, read.damaged), calibration;
    const std::string other = recordings.other_board();
    calibration.refusal = fmt::format(
        "the board is in none of {} images{}: {}", read.looked_at, read.remark_on_damaged(),
        other.empty() ? "look at the board's number of inner corners, show it wholly, sharp, with a white margin"
                      : other);
    return calibration;
  }
  calibration = calibrate_camera(board, views, start, watch);
  calibration.advice = advice(views, *recordings.size());
  calibration.views = std::move(views);
  return calibration;
}

Camera measured_camera(const CameraCalibration& calibration) {
  Camera camera = calibration.camera;
  for (const CameraNumber& number : numbers_of(camera)) number.sigma = rounded_sigma(number.sigma);
  if (camera.covariance) camera.covariance = rounded_covariance(*camera.covariance);
  if (calibration.response) camera.response.sigma = rounded_sigma(calibration.response->sigma);
  return camera;
}

std::vector<CalibratedNumber> calibrated_numbers(const Camera& before, const CameraCalibration& calibration) {
  Camera was = before, is = calibration.camera;
  const auto from = numbers_of(was), to = numbers_of(is);
  std::vector<CalibratedNumber> numbers;
  for (std::size_t i = 0; i < to.size(); ++i) numbers.push_back({to[i].name, from[i].value, to[i].value, to[i].sigma});
  return numbers;
}

}  // namespace lapservo::internal
