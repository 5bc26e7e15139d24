#pragma once
#include <cmath>
#include <fstream>
#include "acceptance/frame_sets.h"
#include "lapservo/calibration/marker_calibration.h"
#include "lapservo/calibration/print_shape.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
namespace lapservo::acceptance {
using namespace internal;
struct Saved { int k, w, h; double cx, cy; double found[8], truth[8]; double blur_b, blur_s, film, tau, turned; bool settled; char type; };
inline void put(double* to, const ShaftPose& p) { for (int i = 0; i < 3; ++i) to[i] = p.camera_from_unrolled.translation[i]; for (int i = 0; i < 4; ++i) to[3 + i] = p.camera_from_unrolled.rotation.coeffs()[i]; to[7] = p.psi_rad; }
inline ShaftPose get(const double* f) { ShaftPose p; p.camera_from_unrolled.translation = Eigen::Map<const Eigen::Vector3d>(f); p.camera_from_unrolled.rotation = Eigen::Quaterniond(Eigen::Vector4d(Eigen::Map<const Eigen::Vector4d>(f + 3))); p.psi_rad = f[7]; return p; }
inline ShaftPose pose_of(const Rig& rig, const JointVector& q) { return PoseUnknowns::rcm(*rig.instruments[0].camera_from_rcm, q).pose(); }
inline Marker true_print(const Rig& nominal_rig, int seed, int i) {
  const double mm = 1e-3; const Marker nominal = nominal_rig.instruments[0].marker;
  Random random(static_cast<std::uint64_t>(1000 * seed + i));
  PrintShape shape = PrintShape::of(nominal);
  const auto off = [&] { return random.uniform(-0.3 * mm, 0.3 * mm); };
  const double end_m = off();
  for (std::size_t k = 1; k < 3; ++k) shape.upper_m[k] += off(), shape.lower_m[k] += off();
  shape.upper_m[3] += end_m, shape.lower_m[3] += end_m + random.uniform(-0.0, 0.0);
  const double wrap_m = random.uniform() < 0.5 ? 1.38 * mm : -1.38 * mm;
  for (double& lower_m : shape.lower_m) lower_m += wrap_m;
  shape.gap_rad = 1 * mm / nominal.radius_m();
  return shape.on(nominal);
}
inline std::vector<std::vector<JointVector>> turn264(const Rig& rig, int frames, std::uint64_t seed) {
  const JointVector start = random_configurations(rig, 1, seed, 0.35)[0][0];
  std::vector<std::vector<JointVector>> all;
  for (int i = 0; i < frames; ++i) {
    const double fraction = static_cast<double>(i) / frames; JointVector q = start;
    q.theta_rad += 0.02 * std::sin(two_pi * fraction), q.phi_rad += 0.02 * std::cos(3 * two_pi * fraction);
    q.psi_rad = wrap_pi(q.psi_rad + 1.05 * two_pi * fraction);
    all.push_back({q});
  }
  return all;
}
struct Loaded { Saved s; KeyFrame key; cv::Mat plain; };
inline std::vector<Loaded> load264(const Rig& rig, const std::string& name) {
  std::ifstream in(name, std::ios::binary); std::vector<Loaded> all; Saved s;
  while (in.read(reinterpret_cast<char*>(&s), sizeof s)) {
    Loaded l{s, {{cv::Mat(s.h, s.w, CV_8UC3), rig.camera}, {PoseUnknowns::free(get(s.found)), {}}}, cv::Mat(s.h, s.w, CV_8UC3)};
    in.read(reinterpret_cast<char*>(l.key.view.bgr.data), s.w * s.h * 3); in.read(reinterpret_cast<char*>(l.plain.data), s.w * s.h * 3);
    l.key.view.camera.width_px = s.w; l.key.view.camera.height_px = s.h; l.key.view.camera.cx_px = s.cx; l.key.view.camera.cy_px = s.cy;
    l.key.sighting.blur = {s.blur_b, s.blur_s}; l.key.sighting.film_m = s.film; l.key.sighting.tau_rad = s.tau; l.key.sighting.settled = s.settled;
    l.key.time_s = s.k; l.key.turned_rad = s.turned;
    all.push_back(std::move(l));
  }
  return all;
}
}
