#include "bench/frames.h"

#include <array>
#include <cmath>

#include "lapservo/kinematics/rcm_coordinates.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::bench {
namespace {

struct Port {
  std::array<double, 3> hues_deg;
  Eigen::Vector3d rcm_m, marker_m;  // in the camera
};

// Ports left, right and above.
const std::array<Port, 3> ports{{{{90, 180, 270}, {-0.078, 0.067, 0.059}, {-0.03, 0.014, 0.095}},
                                 {{180, 270, 90}, {0.103, 0.019, 0.063}, {0.045, 0.01, 0.1}},
                                 {{270, 90, 180}, {-0.02, -0.1, 0.06}, {0.006, -0.032, 0.1}}}};

}  // namespace

Rig scaled_rig(int width_px, int instruments) {
  const double scale = width_px / 1280.0;
  Rig rig;
  Camera& camera = rig.camera;
  camera.width_px = width_px, camera.height_px = static_cast<int>(std::lround(720 * scale));
  camera.fx_px = camera.fy_px = 1100 * scale;
  camera.cx_px = (camera.width_px - 1) / 2.0, camera.cy_px = (camera.height_px - 1) / 2.0;
  for (int i = 0; i < instruments; ++i) {
    const Port& port = ports.at(static_cast<std::size_t>(i));
    Instrument instrument;
    instrument.name = "PSM" + std::to_string(i + 1);
    instrument.marker = {0.0084, port.hues_deg, {0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005}, 0};
    // The RCM frame's x axis points to the work space: phi is near pi/2 there.
    instrument.camera_from_rcm =
        Rigid3{Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), port.marker_m - port.rcm_m), port.rcm_m};
    rig.instruments.push_back(instrument);
  }
  return rig;
}

Renderer make_renderer(const Rig& rig) {
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) {
    ShaftModel shaft;
    shaft.marker = instrument.marker;
    shafts.push_back(shaft);
  }
  return Renderer(rig.camera, shafts, make_tissue(rig.camera.width_px, rig.camera.height_px, 5));
}

std::vector<ShaftPlacement> placements(const Rig& rig, int index) {
  std::vector<ShaftPlacement> placed;
  for (std::size_t i = 0; i < rig.instruments.size(); ++i) {
    const Rigid3& camera_from_rcm = *rig.instruments[i].camera_from_rcm;
    auto q = configuration_through(camera_from_rcm, ports[i].marker_m).value();
    q.theta_rad += 0.02 * std::sin(0.05 * index);
    q.phi_rad += 0.02 * std::cos(0.04 * index);
    q.psi_rad = 0.5 + 0.03 * index;
    placed.push_back({camera_from_rcm * rcm_from_unrolled(q), q.psi_rad});
  }
  return placed;
}

std::vector<cv::Mat> moving_frames(const Rig& rig, int count) {
  Renderer renderer = make_renderer(rig);
  std::vector<cv::Mat> frames;
  for (int i = 0; i < count; ++i) frames.push_back(renderer.render(placements(rig, i), static_cast<std::uint64_t>(i)));
  return frames;
}

cv::Mat empty_frame(const Rig& rig) {
  Rig empty = rig;
  empty.instruments.clear();
  return make_renderer(empty).render({}, 1);
}

}  // namespace lapservo::bench
