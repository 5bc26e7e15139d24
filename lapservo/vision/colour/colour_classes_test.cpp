#include "lapservo/vision/colour/colour_classes.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/geometry/response.h"
#include "lapservo/sim/shaft_lighting.h"

namespace lapservo::internal::colour_classes_test {

using Hues = std::array<double, 3>;
using Bgr = std::array<std::uint8_t, 3>;

constexpr double widest_reach_deg = 34;

ColourClasses classes_of(const std::vector<Hues>& instruments_hues_deg) {
  std::vector<Instrument> instruments;
  for (const Hues& hues_deg : instruments_hues_deg) {
    Instrument instrument;
    instrument.marker.hues_deg = hues_deg;
    instruments.push_back(instrument);
  }
  return ColourClasses(instruments);
}

double gap_deg(double a_deg, double b_deg) {
  return std::abs(std::remainder(a_deg - b_deg, 360.0));
}

// The textbook's HSV, in both directions.
Bgr from_hsv(double hue_deg, double saturation, double value) {
  const auto channel = [&](double n) {
    const double k = std::fmod(n + hue_deg / 60 + 12, 6);
    const double x = value * (1 - saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0));
    return static_cast<std::uint8_t>(std::lround(255 * x));
  };
  return {channel(1), channel(3), channel(5)};
}
double hue_deg_of(const Bgr& p) {
  const double b = p[0], g = p[1], r = p[2];
  return std::atan2(std::sqrt(3.0) * (g - b), 2 * r - g - b) * 180 / pi;  // within 1.2 degrees of HSV's hexagon
}
int chroma_of(const Bgr& p) {
  return *std::max_element(p.begin(), p.end()) - *std::min_element(p.begin(), p.end());
}

double reach_deg(const Hues& hues_deg, std::size_t i) {
  double reach = widest_reach_deg;
  for (std::size_t j = 0; j < 3; ++j)
    if (j != i) reach = std::min(reach, gap_deg(hues_deg[i], hues_deg[j]) / 2);
  return reach;
}

const std::vector<Hues> designs{{90, 180, 270}, {150, 220, 285}, {60, 100, 300}, {350, 110, 230}};

// Five bits a channel leave a hue uncertain by 60 degrees of their quantum in the chroma.
TEST(ColourClasses, TheTableIsTheNearestHueWithinItsReach) {
  for (const Hues& hues_deg : designs) {
    const ColourClasses classes = classes_of({hues_deg});
    Random random(1);
    int ours_checked = 0, others_checked = 0;
    for (int i = 0; i < 30000; ++i) {
      Bgr pixel;
      for (std::uint8_t& channel : pixel) channel = static_cast<std::uint8_t>(random.uniform(0, 256));
      const int chroma = chroma_of(pixel), highest = *std::max_element(pixel.begin(), pixel.end());
      if (chroma < 40 || chroma < 0.3 * highest) continue;
      const double slack_deg = 60 * 8.0 / chroma + 1.2;
      for (std::size_t band = 0; band < 3; ++band) {
        const double gap = gap_deg(hue_deg_of(pixel), hues_deg[band]), reach = reach_deg(hues_deg, band);
        const bool ours = classes(pixel.data()) == classes.of_bands(0)[band];
        if (gap < reach - slack_deg) {
          ++ours_checked;
          EXPECT_TRUE(ours) << "seed 1, hue " << hue_deg_of(pixel) << " for " << hues_deg[band];
        } else if (gap > reach + slack_deg) {
          ++others_checked;
          EXPECT_FALSE(ours) << "seed 1, hue " << hue_deg_of(pixel) << " for " << hues_deg[band];
        }
      }
    }
    EXPECT_GT(ours_checked, 1000);
    EXPECT_GT(others_checked, 1000);
  }
}

// However the hues of several instruments lie beside one another.
TEST(ColourClasses, EachBandHasItsOwnClass) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    std::vector<Hues> designs_of_rig(3);
    for (Hues& hues_deg : designs_of_rig) {
      const double first_deg = random.uniform(0, 360), second_deg = first_deg + random.uniform(40, 150);
      hues_deg = {first_deg, std::fmod(second_deg, 360), std::fmod(second_deg + random.uniform(40, 150), 360)};
    }
    const ColourClasses classes = classes_of(designs_of_rig);
    for (std::size_t k = 0; k < designs_of_rig.size(); ++k)
      for (std::size_t band = 0; band < 3; ++band) {
        double nearest_deg = 360;
        for (const Hues& others_deg : designs_of_rig)
          for (const double other_deg : others_deg)
            if (const double gap_deg = hue_gap_deg(other_deg, designs_of_rig[k][band]); gap_deg > 0)
              nearest_deg = std::min(nearest_deg, gap_deg);
        if (nearest_deg < 8) continue;  // of the table's steps
        EXPECT_EQ(classes(from_hsv(designs_of_rig[k][band], 1, 0.9).data()), classes.of_bands(k)[band])
            << "seed 5, " << i;
      }
  }
}

// Exposure, shading and white balance act on light: the print's classes stand them.
TEST(ColourClasses, APrintKeepsItsClassUnderOtherLight) {
  const Hues hues_deg{90, 180, 270};
  const ColourClasses classes = classes_of({hues_deg});
  const Response srgb;
  Random random(2);
  for (std::size_t band = 0; band < 3; ++band)
    for (int i = 0; i < 1000; ++i) {
      const double exposure = random.uniform(0.05, 1.3);
      const Light print = printed_colour(hues_deg[band]);
      Bgr pixel;
      for (int c = 0; c < 3; ++c) {
        const double light = print[c] * exposure * random.uniform(0.8, 1.25);
        pixel[static_cast<std::size_t>(c)] =
            static_cast<std::uint8_t>(std::lround(255 * srgb.value_from_light(std::min(1.0, light))));
      }
      EXPECT_EQ(classes(pixel.data()), classes.of_bands(0)[band])
          << "seed 2, b g r " << int{pixel[0]} << ' ' << int{pixel[1]} << ' ' << int{pixel[2]};
    }
}

TEST(ColourClasses, GreyAndDarkHaveNoColour) {
  for (const Hues& hues_deg : designs) {
    const ColourClasses classes = classes_of({hues_deg});
    for (int value = 0; value < 256; ++value) {
      const Bgr grey{static_cast<std::uint8_t>(value), static_cast<std::uint8_t>(value),
                     static_cast<std::uint8_t>(value)};
      EXPECT_EQ(classes(grey.data()), 0) << value;
    }
    Random random(3);
    for (int i = 0; i < 30000; ++i) {
      const double base = random.uniform(0, 256);
      Bgr pale, dark;
      for (std::uint8_t& c : pale) c = static_cast<std::uint8_t>(base * random.uniform(0.9, 1));
      for (std::uint8_t& c : dark) c = static_cast<std::uint8_t>(random.uniform(0, 16));
      EXPECT_EQ(classes(pale.data()), 0) << "seed 3";
      EXPECT_EQ(classes(dark.data()), 0) << "seed 3";
    }
  }
}

TEST(ColourClasses, InstrumentsShareTheClassesOfTheirHues) {
  const ColourClasses classes = classes_of({{90, 180, 270}, {270, 90, 180}, {95, 350, 265}});
  EXPECT_EQ(classes.count(), 4);
  for (std::size_t band = 0; band < 3; ++band)
    EXPECT_EQ(classes.of_bands(0)[band], classes.of_bands(1)[(band + 1) % 3]) << band;
  EXPECT_EQ(classes.of_bands(2)[0], classes.of_bands(0)[0]);  // 5 degrees apart: one colour to the camera
  EXPECT_EQ(classes.of_bands(2)[2], classes.of_bands(0)[2]);
  for (std::size_t band = 0; band < 3; ++band) {
    EXPECT_NE(classes.of_bands(2)[1], classes.of_bands(0)[band]);
    EXPECT_NE(classes.of_bands(0)[band], 0);
  }
}

}  // namespace lapservo::internal::colour_classes_test
