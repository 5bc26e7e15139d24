#include "lapservo/vision/colour/colour_evidence.h"

#include <numeric>

#include <gtest/gtest.h>

namespace lapservo::internal::colour_evidence_test {

constexpr std::array places{Place::band, Place::shaft, Place::beside};

TEST(ColourEvidence, FrequenciesOfAPlaceAddUpToOne) {
  for (const auto& shown : colour_frequencies) EXPECT_NEAR(std::accumulate(shown.begin(), shown.end(), 0.0), 1, 2e-3);
}

// Each colour speaks for the place where it is usual, and against another one.
TEST(ColourEvidence, SpeaksForThePlaceOfEachColour) {
  constexpr std::array usual{Shows::its_band, Shows::grey, Shows::other};
  for (std::size_t i = 0; i < places.size(); ++i)
    for (std::size_t k = 0; k < usual.size(); ++k)
      EXPECT_EQ(colour_evidence.of(places[i], usual[k]) > 0, i == k) << i << ' ' << k;
  EXPECT_LT(colour_evidence.of(Place::band, Shows::another_band), -1);
}

// Blood speaks less against a band than grey does; a pixel without a colour lies between both.
TEST(ColourEvidence, IsMildWithBlood) {
  const double blood = colour_evidence.of(Place::band, Shows::other),
               grey = colour_evidence.of(Place::band, Shows::grey);
  EXPECT_GT(blood, 0.5 * grey);
  for (const Place place : places) {
    const double of_grey = colour_evidence.of(place, Shows::grey), of_other = colour_evidence.of(place, Shows::other);
    EXPECT_LT(colour_evidence.of_none(place), std::max(of_grey, of_other));
    EXPECT_GT(colour_evidence.of_none(place), std::min(of_grey, of_other));
  }
  EXPECT_LT(section_gain(false), 0);
}

TEST(ColourEvidence, ShaftIsGreyAndBloodIsNot) {
  const std::array<std::uint8_t, 3> shaft{120, 118, 130}, blood{20, 15, 110}, dark{2, 3, 15};
  EXPECT_EQ(grey_or_other(shaft.data()), Shows::grey);
  EXPECT_EQ(grey_or_other(blood.data()), Shows::other);
  EXPECT_EQ(grey_or_other(dark.data()), Shows::grey);
}

}  // namespace lapservo::internal::colour_evidence_test
