#include "lapservo/control/offset_observer.h"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lapservo/control/test_simulator.h"
#include "lapservo/control/tracking_law.h"

namespace lapservo::internal::offset_observer_test {

using testing::TestRig;

constexpr double period_s = 1.0 / 60;

Eigen::Vector4d measured_at(double time_s) {
  return {0.05 + 0.05 * std::sin(0.7 * time_s), 1.57 + 0.03 * std::sin(0.5 * time_s),
          0.064 + 0.003 * std::sin(0.6 * time_s), 1 + 0.3 * std::sin(0.4 * time_s)};
}

/// Measured joints move, the offset wanders, images come late and noisy.
class Observed {
 public:
  Observed(const ObserverConfig& config, const TestRig& model_rig, double delay_s, std::uint64_t seed)
      : observer(config, Scales{}, testing::model_of(model_rig)), delay_s_(delay_s), random_(seed) {}

  HoldReason advance() {
    ++tick_;
    const double t = now_s();
    for (int i = 0; i < 4; ++i) offset[i] += walk[i] * std::sqrt(period_s) * random_.normal();
    const FeatureState state = exact_map(rig, q_true()).value();
    ImageMeasurement image = testing::image_of(state, t + delay_s_);
    const Eigen::Vector4d noise(5e-4, 0.2, 0.2, 0.2);
    for (int i = 0; i < 4; ++i) image.features[i] += noise[i] * random_.normal();
    image.covariance = noise.cwiseAbs2().asDiagonal();
    images_.push_back(image);
    history.push(t, measured_at(t));
    if (images_.front().time_s > t + 1e-9) return HoldReason::no_history;
    const ImageMeasurement latest = images_.front();
    images_.pop_front();
    return observer.update(latest, history);
  }
  double now_s() const { return tick_ * period_s; }
  Eigen::Vector4d q_true() const { return measured_at(now_s()) + offset; }
  Estimate estimate() const { return observer.at(now_s(), measured_at(now_s())).value(); }

  Eigen::Vector4d error() const { return feature_error(estimate().features, exact_map(rig, q_true())->features); }

  TestRig rig;
  OffsetObserver observer;
  JointHistory history;
  Eigen::Vector4d offset{0.035, -0.035, 0.003, 0.035};
  Eigen::Vector4d walk = Eigen::Vector4d::Zero();

 private:
  double delay_s_;
  Random random_;
  std::deque<ImageMeasurement> images_;
  int tick_ = -1;
};

ObserverConfig known(double delay_s) {
  ObserverConfig config;
  config.delay_s = delay_s;
  return config;
}

TEST(OffsetObserver, CovarianceCoversTheErrors) {
  double squares = 0;
  int samples = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SCOPED_TRACE(seed);
    Observed world(known(0.1), TestRig{}, 0.1, seed);
    world.walk = ObserverConfig{}.offset_walk;
    for (int k = 0; k < 600; ++k) {
      world.advance();
      if (k < 120) continue;
      const Estimate now = world.estimate();
      const Eigen::Vector4d error = now.q - world.q_true();
      squares += error.dot(now.q_covariance.inverse() * error);
      ++samples;
    }
  }
  // Four when exact; less because the walk that comes with motion is allowed for but absent here.
  EXPECT_LT(squares / samples, 4.5);
  EXPECT_GT(squares / samples, 0.4);
}

TEST(OffsetObserver, FollowsTheOffsetAtItsBandwidth) {
  ObserverConfig config = known(0);
  config.bandwidth_rad_s = 5;
  Observed world(config, TestRig{}, 0, 3);
  for (int k = 0; k < 240; ++k) world.advance();
  const Eigen::Vector4d step(0.004, 0.004, 0.0004, 0.01);
  world.offset += step;
  double left_before = 1;
  for (int k = 1; k <= 30; ++k) {
    world.advance();
    const double left = (world.offset - world.observer.offset())[0] / step[0];
    EXPECT_LT(left, left_before + 0.1);
    left_before = left;
  }
  // After 0.5 s at 5 rad/s or faster (motion opens the gain) at most exp(-2.5) is left.
  EXPECT_LT(std::abs(left_before), 0.15);
}

TEST(OffsetObserver, IsUnbiasedInTheImageWithAWrongModel) {
  TestRig wrong;
  wrong.camera.fx_px *= 1.15;
  wrong.camera.fy_px *= 1.15;
  wrong.camera_from_rcm.translation += Eigen::Vector3d(0.008, -0.008, 0.008);
  wrong.camera_from_rcm.rotation =
      wrong.camera_from_rcm.rotation * Eigen::AngleAxisd(0.15, Eigen::Vector3d(0.6, 0, 0.8));
  Observed world(known(0.08), wrong, 0.08, 5);
  Eigen::Vector4d mean = Eigen::Vector4d::Zero();
  int samples = 0;
  for (int k = 0; k < 3000; ++k) {
    world.advance();
    if (k < 200) continue;
    mean += world.error();
    ++samples;
  }
  mean /= samples;
  EXPECT_LT(std::abs(mean[0]), 1.7e-4);
  EXPECT_LT(mean.tail<3>().cwiseAbs().maxCoeff(), 0.1);
}

TEST(OffsetObserver, RejectsAnOutlierAndReacquires) {
  Observed world(known(0), TestRig{}, 0, 9);
  for (int k = 0; k < 200; ++k) world.advance();
  const Eigen::Vector4d before = world.observer.offset();
  ImageMeasurement image = testing::image_of({}, world.now_s());
  image.features = world.estimate().features + Eigen::Vector4d(0.3, 0, 60, 0);
  EXPECT_EQ(world.observer.update(image, world.history), HoldReason::outlier);
  EXPECT_EQ(world.observer.offset(), before);

  world.offset += Eigen::Vector4d(0.1, 0.05, 0.004, 0.3);  // somebody moved the endoscope
  int outliers = 0;
  HoldReason update = world.advance();
  for (; update == HoldReason::outlier; update = world.advance()) ++outliers;
  EXPECT_EQ(update, HoldReason::none);
  EXPECT_EQ(outliers, ObserverConfig{}.reacquire_after - 1);
  EXPECT_LT((world.observer.offset() - world.offset).norm(), 0.02);
}

// An image gives theta and psi within one turn, the measured joints count turns.
TEST(OffsetObserver, TakesTheTurnOfTheMeasuredJoints) {
  const TestRig rig;
  const Scales scales;
  OffsetObserver observer(ObserverConfig{}, scales, testing::model_of(rig));
  JointHistory history;
  const Eigen::Vector4d q_joint(0.05 + two_pi, 1.57, 0.064, 3.12), offset(0.01, -0.01, 0.001, 0.04);
  for (int i = 0; i < 60; ++i) history.push(i * period_s, q_joint);
  ImageMeasurement image = testing::image_of(exact_map(rig, q_joint + offset).value(), 59 * period_s);
  image.q = q_joint + offset - Eigen::Vector4d(two_pi, 0, 0, two_pi);
  EXPECT_EQ(observer.update(image, history), HoldReason::none);
  EXPECT_LT((observer.offset() - offset).norm(), 1e-6);
}

TEST(OffsetObserver, RefusesWhatIsNotANumber) {
  Observed world(known(0), TestRig{}, 0, 9);
  for (int k = 0; k < 100; ++k) world.advance();
  const Eigen::Vector4d before = world.observer.offset();
  ImageMeasurement image = testing::image_of({}, world.now_s());
  image.features[1] = NAN;
  EXPECT_EQ(world.observer.update(image, world.history), HoldReason::non_finite);
  EXPECT_EQ(world.observer.offset(), before);
}

}  // namespace lapservo::internal::offset_observer_test
