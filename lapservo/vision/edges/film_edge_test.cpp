#include "lapservo/vision/edges/film_edge.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/vision/edges/test_profile.h"

namespace lapservo::internal::film_edge_test {

std::vector<FadingPoint> fading(double even_light, double noise, std::uint64_t seed) {
  Random random(seed);
  std::vector<FadingPoint> points;
  for (int i = 0; i < 40; ++i) {
    const double facing = random.uniform(0.4, 0.95);
    points.push_back({facing, 0.3 * (even_light + (1 - even_light) * facing) + noise * random.normal()});
  }
  return points;
}

TEST(EvenLight, IsToldByHowABoundaryFades) {
  for (const double even_light : {0.0, 0.1, 0.3}) {
    auto points = fading(even_light, 0.002, 7);
    points[20].step = 1;  // something else
    const std::array seen{even_light_of(points)};
    EXPECT_NEAR(seen[0].fraction, even_light, 0.02);
    EXPECT_NEAR(usual_or_seen(seen), even_light, 0.04);
  }
}

TEST(EvenLight, IsTheUsualWhereNothingTells) {
  const double usual = usual_or_seen({});
  auto few = fading(0.3, 0, 8);
  few.resize(3);
  EXPECT_EQ(even_light_of(few).certainty, 0);
  EXPECT_NEAR(usual_or_seen(std::array{even_light_of(fading(0.3, 0.3, 9))}), usual, 0.06);
}

// Matt surfaces; half of it in ambient light.
TEST(FilmEdge, IsAsBrightAsItFacesTheLight) {
  EXPECT_NEAR(film_edge_light({0.8, 0.8}, 0), 1, 1e-9);
  EXPECT_NEAR(film_edge_light({0.8, 0.3}, 1), 1, 1e-9);
  EXPECT_NEAR(film_edge_light({1, 0.01}, 0), 0.01, 1e-9);
  EXPECT_GT(film_edge_light({0.3, 0.8}, 0.1), 1.5);
}

// A matt film's edge between a shaft of any grey and a blue outside, both with a highlight, behind a veil.
TEST(EndLight, TellsTheLevelOfTheFilmsEdge) {
  constexpr float veil = 0.05F, film_edge = 0.3F;
  const Eigen::Vector3f blue(0.5F, 0.1F, 0.02F);
  for (const float shaft : {0.02F, 0.15F, 0.4F, 0.8F}) {
    SCOPED_TRACE(shaft);
    std::vector<EndPoint> points;
    std::vector<Eigen::Vector3f> edges;
    for (int i = 0; i < 20; ++i) {
      const float light = 0.5F + 0.02F * static_cast<float>(i), gloss = veil + (i % 5 == 4 ? 0.05F : 0);
      points.emplace_back() << Eigen::Vector3f::Constant(shaft * light + gloss),
          light * blue + Eigen::Vector3f::Constant(gloss);
      edges.emplace_back(film_edge * light * blue + Eigen::Vector3f::Constant(veil));
    }
    const EndLight end(points);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3f step = points[i].col(1) - points[i].col(0), up = edges[i] - points[i].col(0);
      EXPECT_NEAR(end.matt_level(film_edge) - end.gloss_level(i), step.dot(up) / step.squaredNorm(), 0.03) << i;
      EXPECT_NEAR(end.level(film_edge, i, 0) * static_cast<double>(step[0]), up[0], 0.01) << i;
    }
  }
}

// Where all of it is saturated a channel says nothing.
TEST(EndLight, OfASaturatedChannelCountsForNothing) {
  std::vector<EndPoint> points(20), others(20);
  for (EndPoint& point : points) point << 0.3F, 0.5F, 0.3F, 0.1F, 0, 0;
  for (EndPoint& point : others) point << 0.3F, 0.5F, 0.3F, 0.1F, 0.3F, 0.3F;
  EXPECT_NEAR(EndLight(points).matt_level(0.3), EndLight(others).matt_level(0.3), 1e-6);
}

double blurred(double from_edge_px) {
  return 0.5 * std::erfc(-from_edge_px / std::sqrt(2.0));
}

// Shaft, the film's edge from 0 to `width`, the outside; blurred by a pixel. By what fraction of the width inwards a
// step is located.
double located(double level, double width_px) {
  TestProfile profile{.reach = 5};
  for (int i = 0; i < profile.count; ++i) {
    const double x = i - profile.reach + 0.5 * width_px;
    profile.light[static_cast<std::size_t>(i)].fill(
        static_cast<float>(0.05 + 0.3 * (level * blurred(x) + (1 - level) * blurred(x - width_px))));
  }
  const EdgeFit fit = profile.fit(1, 20);
  EXPECT_TRUE(fit.converged);
  return 0.5 - fit.offset_px / width_px;
}

TEST(FilmShift, IsWhereAStepIsLocated) {
  for (const double width : {0.5, 1.0, 1.5})
    for (const double level : {-0.2, 0.0, 0.2, 0.5, 0.9, 1.2, 1.6, 2.2}) {
      const FilmShift shift = film_shift(level, width);
      EXPECT_NEAR(shift.fraction, located(level, width), 0.015 + 0.02 * std::abs(level)) << level << " " << width;
    }
}

// A thick film from near by: the whole solution has 0.11 at a level of 0.2, 0.92 at 0.8.
TEST(FilmShift, StaysWithinTheStripWhereItIsWide) {
  for (const double width : {3.0, 4.0, 6.0, 20.0}) {
    EXPECT_NEAR(film_shift(0.2, width).fraction, 0.11, 0.04) << width;
    EXPECT_NEAR(film_shift(0.8, width).fraction, 0.89, 0.04) << width;
  }
}

TEST(FilmShift, ChangesWithTheWidthAsItSays) {
  for (const double level : {-0.2, 0.3, 1.6})
    for (const double width : {0.3, 1.5, 4.0}) {
      constexpr double step = 1e-4;
      const auto moved = [&](double w) { return film_shift(level, w).fraction * w; };
      EXPECT_NEAR(film_shift(level, width).by_width, (moved(width + step) - moved(width - step)) / (2 * step), 1e-6);
    }
}

}  // namespace lapservo::internal::film_edge_test
