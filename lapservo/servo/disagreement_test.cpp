#include "lapservo/servo/disagreement.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/testing/has.h"
#include "lapservo/testing/rigs.h"

namespace lapservo::internal::disagreement_test {

using Cause = Explanation::Cause;

// Joints on their way and what the camera sees of the instrument, 20 a second.
struct World {
  Eigen::Vector4d sign = Eigen::Vector4d::Ones(), offset = Eigen::Vector4d::Zero();  ///< of the joints as they are read
  Rigid3 rcm_from_true_rcm;                                                          ///< of camera_from_rcm
  double moves_s = 1e9, moves_for_s = 0;
  Eigen::Vector3d moves_m{0.006, -0.004, 0.008};
  Eigen::Vector4d swing{0.12, 0.1, 0.012, 0.5};
  double duration_s = 3;
};

const Instrument& instrument() {
  static const Rig rig = testing::paper_test_rig();
  return rig.instruments[0];
}

std::vector<MarkerSighting> seen_in(const World& world, std::uint64_t seed) {
  Random random(seed);
  std::vector<MarkerSighting> seen;
  const Eigen::Vector4d from(0.05, 1.57, 0.064, 1.2), speed(1.1, 0.8, 1.4, 0.9);
  const Eigen::Vector4d usual(0.02, -0.02, 0.002, 0.03);  // of a usable rig
  for (double t = 0; t < world.duration_s; t += 0.05) {
    const Eigen::Vector4d phase = t * speed, wave = phase.array().sin(), slope = phase.array().cos();
    const Eigen::Vector4d q = from + world.swing.cwiseProduct(wave);
    MarkerSighting one;
    one.time_s = t;
    one.q = world.sign.cwiseProduct(q - from) + from + world.offset;
    one.q_rate = world.sign.cwiseProduct(world.swing).cwiseProduct(speed).cwiseProduct(slope);
    const Eigen::Vector4d then = q - 0.05 * world.swing.cwiseProduct(speed).cwiseProduct(slope) + usual;
    const double moved = world.moves_for_s > 0 ? std::clamp((t - world.moves_s) / world.moves_for_s, 0.0, 1.0)
                                               : static_cast<double>(t >= world.moves_s);
    Rigid3 camera_from_rcm = *instrument().camera_from_rcm * world.rcm_from_true_rcm;
    camera_from_rcm.translation += moved * world.moves_m;
    const Rigid3 unrolled = camera_from_rcm * rcm_from_unrolled(JointVector::from_vector(then));
    one.camera_from_marker = camera_from_marker(instrument().marker, unrolled, then[3]);
    one.camera_from_marker.translation += 1e-4 * Eigen::Vector3d(random.normal(), random.normal(), 4 * random.normal());
    const Eigen::Vector3d turned(random.normal(), random.normal(), random.normal());
    one.camera_from_marker.rotation = rotation_by(3e-3 * turned) * one.camera_from_marker.rotation;
    seen.push_back(one);
  }
  return seen;
}

Explanation explanation_of(const World& world, std::uint64_t seed = 3) {
  return explain_disagreement(seen_in(world, seed), instrument());
}

// Nothing moved: a wrong sign looks like a wrong offset.
TEST(Disagreement, IsNotToldApartWhereTheDataDoNotTell) {
  World world;
  world.swing.setZero();
  world.offset[1] = 0.6;
  const Explanation still = explanation_of(world);
  EXPECT_EQ(still.cause, Cause::rig);
  EXPECT_NE(still.text(instrument()).find("does not show which"), std::string::npos);
  EXPECT_EQ(explain_disagreement({}, instrument()).cause, Cause::unknown);
}

// By a usable rig's errors at most, and beyond.
World random_world(Cause cause, int joint, Random& random) {
  World world;
  world.duration_s = random.uniform(1.5, 4);
  world.swing *= random.uniform(0.5, 1.5);
  const double side = random.uniform(0, 1) < 0.5 ? -1 : 1;
  if (cause == Cause::sign) world.sign[joint] = -1;
  if (cause == Cause::offset)
    world.offset[joint] = side * (joint == 2 ? random.uniform(0.02, 0.05) : random.uniform(0.4, 1.2));
  if (cause == Cause::registration)
    world.rcm_from_true_rcm = {rotation_by(random.uniform(0, 0.4) * testing::random_direction(random)),
                               random.uniform(0.01, 0.03) * testing::random_direction(random)};
  if (cause == Cause::moved) {
    world.moves_s = random.uniform(0.5, 0.9) * world.duration_s;
    world.moves_for_s = random.uniform(0, 1) < 0.5 ? 0 : random.uniform(0.1, 1);
    world.moves_m = random.uniform(0.005, 0.02) * testing::random_direction(random);
  }
  return world;
}

TEST(Disagreement, NamesTheCauseOfRandomWorlds) {
  Random random(1);
  constexpr int worlds = 8;
  for (const Cause cause : {Cause::none, Cause::moved, Cause::sign, Cause::offset, Cause::registration}) {
    int named = 0;
    for (int joint = 0; joint < worlds; ++joint) {
      const World world = random_world(cause, joint % 4, random);
      const Explanation found = explanation_of(world, static_cast<std::uint64_t>(joint));
      const bool of_a_joint = cause == Cause::sign || cause == Cause::offset;
      named += found.cause == cause && (!of_a_joint || found.joint == joint % 4);
      if (of_a_joint && found.cause == cause) {
        const char* const what = cause == Cause::sign ? "joints.sign of " : "joints.offset of ";
        EXPECT_TRUE(testing::has(found.text(instrument()), what));
      }
    }
    EXPECT_GE(named, 0.9 * worlds) << static_cast<int>(cause);
  }
}

}  // namespace lapservo::internal::disagreement_test
