#include "lapservo/report/svg_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/report/test_markup.h"

namespace lapservo::internal::svg_plot_test {
using testing::count_of;

constexpr std::uint64_t seed = 71;

TEST(Ticks, AreRoundEvenAndInside) {
  Random random(seed);
  for (int i = 0; i < 2000; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", draw " << i);
    const double low = random.normal() * std::pow(10, random.uniform(-6, 6));
    const double high = low + std::abs(low) * std::pow(10, random.uniform(-4, 3));
    const int most = 5 + static_cast<int>(random.uniform(0, 6));
    const auto ticks = nice_ticks(low, high, most);
    ASSERT_GE(ticks.size(), 2U);
    ASSERT_LE(ticks.size(), static_cast<std::size_t>(most));
    const double step = (ticks.back() - ticks[0]) / static_cast<double>(ticks.size() - 1), slack = 1e-6 * step;
    for (std::size_t k = 0; k < ticks.size(); ++k) {
      EXPECT_GE(ticks[k], low - slack);
      EXPECT_LE(ticks[k], high + slack);
      EXPECT_NEAR(ticks[k], ticks[0] + step * static_cast<double>(k), slack);
      EXPECT_NEAR(ticks[k] / step, std::round(ticks[k] / step), 1e-4);
    }
    // None is left out at either end.
    EXPECT_LT(ticks[0] - low, step + slack);
    EXPECT_LT(high - ticks.back(), step + slack);
    const double leading = step / std::pow(10, std::floor(std::log10(step) + 1e-9));
    EXPECT_LT(std::min({std::abs(leading - 1), std::abs(leading - 2), std::abs(leading - 5)}), 1e-6) << step;
  }
}

TEST(Ticks, OnALogarithmicAxisAreOneTwoOrFiveTimesAPowerOfTen) {
  Random random(seed);
  for (int i = 0; i < 500; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", draw " << i);
    const double low = std::pow(10, random.uniform(-8, 4)), high = low * std::pow(10, random.uniform(1, 12));
    const auto ticks = nice_logarithmic_ticks(low, high);
    ASSERT_GE(ticks.size(), 2U);
    EXPECT_LE(ticks.size(), 9U);
    EXPECT_TRUE(std::is_sorted(ticks.begin(), ticks.end()));
    for (const double tick : ticks) {
      EXPECT_GE(tick, low * 0.999999);
      EXPECT_LE(tick, high * 1.000001);
      const double leading = tick / std::pow(10, std::floor(std::log10(tick) + 1e-9));
      EXPECT_LT(std::min({std::abs(leading - 1), std::abs(leading - 2), std::abs(leading - 5)}), 1e-6) << tick;
    }
  }
}

TEST(TickLabels, TellTheTicksApartAndSayTheirValue) {
  Random random(seed);
  for (int i = 0; i < 1000; ++i) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", draw " << i);
    const bool logarithmic = i % 2 == 0;
    const double low = std::pow(10, random.uniform(-7, 5)) * (logarithmic || i % 4 == 1 ? 1 : -1);
    const double high = logarithmic ? low * std::pow(10, random.uniform(1, 9))
                                    : low + std::abs(low) * std::pow(10, random.uniform(-3, 2));
    const auto ticks = logarithmic ? nice_logarithmic_ticks(low, high) : nice_ticks(low, high, 6);
    const auto labels = tick_labels(ticks);
    ASSERT_EQ(labels.size(), ticks.size());
    EXPECT_EQ(std::set<std::string>(labels.begin(), labels.end()).size(), labels.size());
    const double step = ticks[1] - ticks[0];
    for (std::size_t k = 0; k < ticks.size(); ++k) {
      EXPECT_NEAR(std::stod(labels[k]), ticks[k], 1e-3 * std::abs(step)) << labels[k];
      EXPECT_NE(labels[k], "-0");
    }
  }
  EXPECT_EQ(tick_labels({-0.5, 0.0, 0.5}), (std::vector<std::string>{"-0.5", "0.0", "0.5"}));
  EXPECT_EQ(tick_labels({0, 200, 400}), (std::vector<std::string>{"0", "200", "400"}));
  EXPECT_EQ(tick_labels({0.01, 0.1, 1, 10}), (std::vector<std::string>{"0.01", "0.1", "1", "10"}));
}

TEST(Escaped, LeavesNoMarkup) {
  EXPECT_EQ(escaped("a<b> & \"c\" 'd'"), "a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39;");
  EXPECT_EQ(escaped("px \u00b1 2"), "px \u00b1 2");
  EXPECT_EQ(escaped(std::string("a\x01\x1f\0b", 5)), "ab");
}

Plot hostile_plot() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  const std::string name = "<script>&\"'</title>";
  Plot plot{name, {name, name, {}, {}}, {name, name, {}, {}}, {}, {{name, 3}}, false};
  int colour = -1;
  for (const Draw draw : {Draw::line, Draw::dashed, Draw::points, Draw::rings, Draw::line_and_points})
    plot.series.push_back({name, {0, 1, nan, 3, 4, -infinity}, {1, infinity, 2, nan, 5, 0}, draw, colour++});
  return plot;
}

TEST(Svg, IsWellFormedWhateverTheNamesAndNumbers) {
  for (const bool image_plane : {false, true})
    for (const bool logarithmic : {false, true}) {
      Plot plot = hostile_plot();
      plot.image_plane = image_plane;
      plot.y.logarithmic = logarithmic && !image_plane;
      const std::string svg = svg_from(plot);
      EXPECT_EQ(testing::markup_problem(svg), "");
      EXPECT_EQ(svg.find("<script"), std::string::npos);
      for (const char* word : {"nan", "inf", "e+", "-0.0 "}) EXPECT_EQ(svg.find(word), std::string::npos) << word;
    }
}

TEST(Svg, OfNothingOrOneConstantHasAxesAllTheSame) {
  Plot plot{"empty", {"x", "s", {}, {}}, {"y", "px", {}, {}}, {}, {}, false};
  EXPECT_EQ(testing::markup_problem(svg_from(plot)), "");
  EXPECT_GE(count_of(svg_from(plot), "class=\"grid\""), 4U);
  for (const double constant : {0.0, 5.0, -1e-7, 1e9}) {
    plot.series = {{"constant", {1, 2, 3}, {constant, constant, constant}, Draw::line_and_points, 0}};
    EXPECT_GE(count_of(svg_from(plot), "class=\"grid\""), 4U) << constant;
    EXPECT_EQ(svg_from(plot).find("nan"), std::string::npos) << constant;
  }
}

TEST(Svg, DrawsEachPointOnceAndTellsItsNumbers) {
  Plot plot{"points", {"time", "s", {}, {}}, {"error", "mrad", {}, {}}, {}, {}, false};
  plot.series.push_back({"psi", {0, 1, 2}, {10, 20.5, 30}, Draw::points, 0});
  const std::string svg = svg_from(plot);
  EXPECT_EQ(count_of(svg, "class=\"point f-c0\" transform="), 3U + 1U) << "and one in the legend";
  EXPECT_NE(svg.find("<title>psi: time 1 s, error 20.5 mrad</title>"), std::string::npos);
}

TEST(Svg, RingsShowAroundPointsAtTheSamePlaces) {
  Plot plot{"both", {"time", "s", {}, {}}, {"error", "px", {}, {}}, {}, {}, false};
  plot.series.push_back({"before", {0, 1}, {1, 2}, Draw::rings, 0});
  plot.series.push_back({"after", {0, 1}, {1, 2}, Draw::points, 0});
  const std::string svg = svg_from(plot);
  const auto radius_of = [&](const std::string& kind) {
    double x = 0, y = 0, radius = 0;
    EXPECT_EQ(count_of(svg, kind), 2U + 1U) << "and one in the legend";
    const std::string place = kind + "\" transform=\"translate(";
    std::sscanf(svg.c_str() + svg.rfind(place) + place.size(), "%lf %lf) scale(%lf", &x, &y, &radius);
    return radius;
  };
  EXPECT_GT(radius_of("class=\"ring s-c0"), 1.5 * radius_of("class=\"point f-c0"));
}

// On the image plane a square is a square, and v grows downwards.
TEST(Svg, TheImagePlaneHasOneScale) {
  Plot plot{"corners", {"u", "px", {}, {}}, {"v", "px", {}, {}}, {}, {}, true};
  plot.series.push_back({"", {0, 100, 300}, {0, 100, 0}, Draw::line, 0});
  const std::string svg = svg_from(plot);
  const std::size_t at = svg.find("class=\"line s-c0\" d=\"M");
  ASSERT_NE(at, std::string::npos);
  double u0 = 0, v0 = 0, u1 = 0, v1 = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + at, "class=\"line s-c0\" d=\"M%lf %lfL%lf %lf", &u0, &v0, &u1, &v1), 4);
  EXPECT_GT(u1 - u0, 10);
  EXPECT_NEAR(u1 - u0, v1 - v0, 0.25);
}

// Quartiles 2.5 and 4.5, whiskers at 1 and 5; 100 lies beyond.
TEST(Svg, ABoxHasItsQuartilesWhiskersAndOutliers) {
  Plot plot{"boxes", {"trial", "", 0, 2}, {"error", "mrad", 0, 100}, {}, {}, false};
  plot.series.push_back({"", {1, 1, 1, 1, 1, 1, 1}, {1, 2, 3, 3, 4, 5, 100}, Draw::boxes, 0});
  const std::string svg = svg_from(plot);
  EXPECT_EQ(testing::markup_problem(svg), "");
  EXPECT_EQ(count_of(svg, "class=\"box "), 1U);
  EXPECT_EQ(count_of(svg, "<title>trial 1, error 100 mrad</title>"), 1U);
  double x = 0, low = 0, width = 0, high = 0, whisker_x = 0, from_low = 0, to_low_whisker = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("class=\"box "), "class=\"box s-c0 f-c0\" d=\"M%lf %lfh%lfV%lf", &x,
                        &low, &width, &high),
            4);
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("class=\"bar "), "class=\"bar s-c0\" d=\"M%lf %lfV%lf", &whisker_x,
                        &to_low_whisker, &from_low),
            3);
  EXPECT_NEAR(whisker_x, x + width / 2, 0.2);
  EXPECT_NEAR(low, from_low, 0.2);
  EXPECT_NEAR((low - high) / (to_low_whisker - low), (4.5 - 2.5) / (2.5 - 1), 0.1);
}

TEST(Svg, LimitsLeaveOutliersOutAndCountThem) {
  Random random(seed);
  Plot plot{"cloud", {"u", "px", {}, {}}, {"v", "px", {}, {}}, {}, {}, true};
  plot.series.push_back({"", {}, {}, Draw::points, 0});
  for (int i = 0; i < 50; ++i) {
    plot.series[0].x.push_back(random.normal());
    plot.series[0].y.push_back(random.normal());
  }
  EXPECT_EQ(points_outside(plot), 0U);
  plot.series[0].x.push_back(1000), plot.series[0].y.push_back(0);
  plot.series[0].x.push_back(0), plot.series[0].y.push_back(-1000);
  EXPECT_EQ(points_outside(plot), 0U) << "nothing is left out unasked";
  limit_to_most(plot);
  EXPECT_EQ(points_outside(plot), 2U);
  EXPECT_LT(*plot.x.high, 10);
}

}  // namespace lapservo::internal::svg_plot_test
