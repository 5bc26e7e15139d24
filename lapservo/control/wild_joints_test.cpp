#include "lapservo/control/wild_joints.h"

#include <gtest/gtest.h>

namespace lapservo::internal::wild_joints_test {

using Verdict = WildJoints::Verdict;
constexpr double period_s = 1.0 / 60;
const Eigen::Vector4d rate(0.4, 0.4, 0.04, 1.5), start(0, 1.5, 0.08, 0.5);

TEST(WildJoints, MotionUpToThreeTimesTheRateIsPlausible) {
  for (const double times : {0.0, 1.0, 2.9}) {
    WildJoints joints(rate);
    for (int k = 0; k < 100; ++k)
      EXPECT_EQ(joints.validate(k * period_s, start + times * k * period_s * rate), Verdict::plausible) << k;
  }
}

TEST(WildJoints, WhatFlashesUpIsWild) {
  for (int i = 0; i < 4; ++i) {
    WildJoints joints(rate);
    Eigen::Vector4d wild = start;
    wild[i] += i == 2 ? 0.02 : 0.3;
    EXPECT_EQ(joints.validate(0, start), Verdict::plausible);
    for (int k = 1; k < 40; ++k)
      EXPECT_EQ(joints.validate(k * period_s, k % 4 == 0 ? wild : start),
                k % 4 == 0 ? Verdict::wild : Verdict::plausible);
  }
}

TEST(WildJoints, WhereTheyStayTheyAre) {
  WildJoints joints(rate);
  const Eigen::Vector4d there = start + Eigen::Vector4d(0.3, 0, 0, 0);
  EXPECT_EQ(joints.validate(0, start), Verdict::plausible);
  EXPECT_EQ(joints.validate(1 * period_s, there), Verdict::wild);
  EXPECT_EQ(joints.validate(2 * period_s, there), Verdict::wild);
  EXPECT_EQ(joints.validate(3 * period_s, there), Verdict::jumped);
  EXPECT_EQ(joints.validate(4 * period_s, there), Verdict::plausible);
  EXPECT_EQ(joints.validate(5 * period_s, start), Verdict::wild);
}

}  // namespace lapservo::internal::wild_joints_test
