#include "bench/frames.h"

#include <array>
#include <cmath>
#include <map>
#include <string_view>
#include <tuple>

#include <opencv2/imgproc.hpp>

#include "lapservo/geometry/rotation.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::bench {
using namespace internal;
namespace {

struct Port {
  std::array<double, 3> hues_deg;
  Eigen::Vector3d rcm_m, marker_m;  // in the camera
};

// Ports left, right and above.
const std::array<Port, 3> ports{{{{90, 180, 270}, {-0.078, 0.067, 0.059}, {-0.03, 0.014, 0.095}},
                                 {{180, 270, 90}, {0.103, 0.019, 0.063}, {0.045, 0.01, 0.1}},
                                 {{270, 90, 180}, {-0.02, -0.1, 0.06}, {0.006, -0.032, 0.1}}}};

constexpr std::array<std::array<int, 2>, 4> sizes_px{{{640, 480}, {1280, 720}, {1920, 1080}, {3840, 2160}}};

// Tag 0 of the family 36h11 on white paper: with a narrower border, aruco takes the paper's edge for the tag's.
constexpr std::array<std::string_view, 12> tag{"............", "............", "..########..", "..#..#.#.#..",
                                               "..##...#.#..", "..##..####..", "..#.#.####..", "..##.#..##..",
                                               "..####.###..", "..########..", "............", "............"};

// As a camera shows it: neither black nor white, blurred and noisy. Below the instruments, on the right.
void paint_tag(cv::Mat& frame, double cell_px) {
  const int cells = static_cast<int>(tag.size()), side_px = static_cast<int>(std::lround(cell_px * cells));
  cv::Mat grey(cells, cells, CV_8U);
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column)
      grey.at<std::uint8_t>(row, column) =
          tag[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)] == '#' ? 25 : 190;
  cv::Mat printed, noise(side_px, side_px, CV_8UC3);
  cv::resize(grey, printed, {side_px, side_px}, 0, 0, cv::INTER_NEAREST);
  cv::GaussianBlur(printed, printed, {}, 1.2);
  cv::cvtColor(printed, printed, cv::COLOR_GRAY2BGR);
  cv::RNG(7).fill(noise, cv::RNG::NORMAL, 8, 2);
  printed += noise;
  const cv::Rect place(frame.cols - side_px - side_px / 2, frame.rows - side_px - side_px / 8, side_px, side_px);
  printed.copyTo(frame(place));
}

using Key = std::tuple<int, double, std::size_t>;
Key key_of(const Rig& rig) {
  return {rig.camera.width_px, rig.camera.fx_px, rig.instruments.size()};
}

Rig rig_with(cv::Size size_px, double focal_px, int instruments) {
  Rig rig;
  Camera& camera = rig.camera;
  camera.width_px = size_px.width, camera.height_px = size_px.height;
  camera.fx_px = camera.fy_px = focal_px;
  camera.cx_px = (camera.width_px - 1) / 2.0, camera.cy_px = (camera.height_px - 1) / 2.0;
  for (int i = 0; i < instruments; ++i) {
    const Port& port = ports.at(static_cast<std::size_t>(i));
    Instrument instrument;
    instrument.name = "PSM" + std::to_string(i + 1);
    instrument.marker = {0.0084, port.hues_deg, {0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005}, 0};
    // The RCM frame's x axis points to the work space: phi is near pi/2 there.
    instrument.camera_from_rcm =
        Rigid3{rotation_between(Eigen::Vector3d::UnitX(), port.marker_m - port.rcm_m), port.rcm_m};
    rig.instruments.push_back(instrument);
  }
  return rig;
}

}  // namespace

Rig scaled_rig(cv::Size size_px, int instruments) {
  return rig_with(size_px, 1100.0 / 1280 * size_px.width, instruments);
}

Rig fixed_marker_rig(cv::Size size_px) {
  return rig_with(size_px, 550, 1);
}

Renderer make_renderer(const Rig& rig) {
  return Renderer(rig.camera, shafts_of(rig), make_tissue(rig.camera.width_px, rig.camera.height_px, 5));
}

std::vector<JointVector> configurations(const Rig& rig, int index) {
  std::vector<JointVector> all;
  for (std::size_t i = 0; i < rig.instruments.size(); ++i) {
    auto q = configuration_through(*rig.instruments[i].camera_from_rcm, ports[i].marker_m).value();
    q.theta_rad += 0.02 * std::sin(0.05 * index);
    q.phi_rad += 0.02 * std::cos(0.04 * index);
    q.psi_rad = 0.5 + 0.03 * index;
    all.push_back(q);
  }
  return all;
}

std::vector<ShaftPlacement> placements(const Rig& rig, int index) {
  std::vector<ShaftPlacement> placed;
  const auto all = configurations(rig, index);
  for (std::size_t i = 0; i < all.size(); ++i) placed.push_back(placement_of(rig.instruments[i], all[i]));
  return placed;
}

const std::vector<cv::Mat>& moving_frames(const Rig& rig) {
  static std::map<Key, std::vector<cv::Mat>> rendered;
  std::vector<cv::Mat>& frames = rendered[key_of(rig)];
  if (frames.empty()) {
    Renderer renderer = make_renderer(rig);
    for (int i = 0; i < static_cast<int>(moving_frame_count); ++i) {
      frames.push_back(renderer.render(placements(rig, i), static_cast<std::uint64_t>(i)));
      paint_tag(frames.back(), 15.0 / 1100 * rig.camera.fx_px);
    }
  }
  return frames;
}

const cv::Mat& moving_frame(const std::vector<cv::Mat>& frames, std::size_t index) {
  const std::size_t turn = 2 * frames.size() - 2, place = index % turn;
  return frames[place < frames.size() ? place : turn - place];
}

const cv::Mat& empty_frame(const Rig& rig) {
  static std::map<Key, cv::Mat> rendered;
  cv::Mat& frame = rendered[key_of(rig)];
  Rig empty = rig;
  empty.instruments.clear();
  if (frame.empty()) frame = make_renderer(empty).render({}, 1);
  return frame;
}

void every_size(benchmark::internal::Benchmark* benchmark) {
  for (const auto& size : sizes_px) benchmark->Args({size[0], size[1]});
  benchmark->ArgNames({"width", "height"})->Unit(benchmark::kMillisecond);
}

void every_size_and_number(benchmark::internal::Benchmark* benchmark) {
  for (const auto& size : sizes_px)
    for (const int instruments : {1, 2, 3}) benchmark->Args({size[0], size[1], instruments});
  benchmark->ArgNames({"width", "height", "instruments"})->Unit(benchmark::kMillisecond);
}

}  // namespace lapservo::bench
