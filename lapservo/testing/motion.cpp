#include "lapservo/testing/motion.h"

#include <Eigen/Cholesky>

#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::scenes {
using namespace internal;
namespace {

// The smallest change of theta, phi and rho that moves the marker's middle so in the image.
Eigen::Vector3d joints_of(const Rig& rig, const Eigen::Vector4d& q, const Eigen::Vector2d& along_and_across_px) {
  const Instrument& instrument = rig.instruments[0];
  const auto place_px = [&](const Eigen::Vector4d& at, double along_m) {
    return rig.camera.raw_from_point(placement_of(instrument, JointVector::from_vector(at)).camera_from_unrolled *
                                     Eigen::Vector3d(0, 0, along_m));
  };
  const double middle_m = instrument.marker.length_m() / 2;
  const Eigen::Vector2d along = (place_px(q, 2 * middle_m) - place_px(q, 0)).normalized();
  const Eigen::Vector2d motion_px =
      along_and_across_px.x() * along + along_and_across_px.y() * Eigen::Vector2d(-along.y(), along.x());
  const Eigen::Vector3d steps(1e-3, 1e-3, 1e-4);
  Eigen::Matrix<double, 2, 3> px_per_step;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d step = steps[i] * Eigen::Vector4d::Unit(i);
    px_per_step.col(i) = (place_px(q + step, middle_m) - place_px(q - step, middle_m)) / 2;
  }
  const Eigen::Vector3d taken =
      px_per_step.transpose() * (px_per_step * px_per_step.transpose()).ldlt().solve(motion_px);
  return taken.cwiseProduct(steps);
}

}  // namespace

Exposure moving_exposure(const Rig& rig, const JointVector& q, const Motion& motion) {
  constexpr int moments = 9;
  Eigen::Vector4d change = Eigen::Vector4d::Zero();
  change.head<3>() = joints_of(rig, q.vector(), motion.along_and_across_px);
  change[3] = motion.turn_rad;
  const auto part = [&](double time) { return motion.from_rest ? time * time : time; };
  Exposure exposure;
  for (int i = 0; i < moments; ++i) {
    const double moved = part((i + 0.5) / moments) - part(0.5);
    exposure.push_back({placement_of(rig.instruments[0], JointVector::from_vector(q.vector() + moved * change))});
  }
  return exposure;
}

cv::Mat render_moving(const Rig& rig, const JointVector& q, const Motion& motion) {
  return renderer_of(rig, shaft_of(rig.instruments[0])).render_exposure(moving_exposure(rig, q, motion), 1);
}

}  // namespace lapservo::scenes
