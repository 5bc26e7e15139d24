#include "lapservo/geometry/rotation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::rotation_test {

constexpr std::uint64_t seed = 31;

Eigen::Vector3d random_direction(Random& random) {
  return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

TEST(RotationBetween, TakesOneDirectionToTheOtherTheShortestWay) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d from = random_direction(random), to = random_direction(random);
    const Eigen::Quaterniond rotation = rotation_between(2 * from, 0.1 * to);
    EXPECT_NEAR(rotation.norm(), 1, 1e-14);
    EXPECT_LT((rotation * from - to).norm(), 1e-12);
    EXPECT_NEAR(rotation.angularDistance(Eigen::Quaterniond::Identity()), std::acos(from.dot(to)), 1e-7);
  }
}

TEST(RotationBetween, OfEqualDirectionsIsNoneAndOfOppositeOnesHalfATurn) {
  testing::SeededRandom random(seed + 1);
  for (const double off : {0.0, 1e-15, 1e-9, 1e-7, 1e-6, 1e-4})
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector3d from = random_direction(random), aside = from.unitOrthogonal();
      EXPECT_LT((rotation_between(from, from + off * aside) * from - (from + off * aside).normalized()).norm(), 1e-12);
      const Eigen::Vector3d opposite = -from + off * aside;
      EXPECT_LT((rotation_between(from, opposite) * from - opposite.normalized()).norm(), 3e-6) << off;
    }
}

TEST(RotationVector, GoesThereAndBackTheShorterWay) {
  for (const double angle_rad : {0.0, 1e-9, 0.3, 3.1}) {
    const Eigen::Vector3d vector = angle_rad * Eigen::Vector3d(1, -2, 2) / 3;
    Eigen::Quaterniond rotation = rotation_by(vector);
    EXPECT_LT((rotation_vector_of(rotation) - vector).norm(), 1e-12);
    rotation.coeffs() *= -1;  // the same rotation
    EXPECT_LT((rotation_vector_of(rotation) - vector).norm(), 1e-12);
  }
}

}  // namespace lapservo::internal::rotation_test
