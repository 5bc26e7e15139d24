#include "lapservo/core/known_keys.h"

#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::known_keys_test {

const KnownKeys known{{"name"}, {"seam_rad", "hues_deg"}};

std::string complaint(const std::string& yaml) {
  return testing::input_error([&] { expect_keys(YamlField::parse(yaml, "a.yaml", "file of ours"), known); });
}

TEST(KnownKeys, TakesWhatItKnows) {
  for (const char* yaml :
       {"{}", "name: x", "seam_rad: 1\nname: y", "seam_rad: 1\nsigma_seam_rad: 0.1",
        "hues_deg: [1, 2]\nsigma_hues_deg: [0, 0.5]", "hues_deg: {data: 1}\nsigma_hues_deg: {data: 1}"})
    EXPECT_EQ(complaint(yaml), "") << yaml;
}

TEST(KnownKeys, NamesTheNearest) {
  const auto unknown = [](const std::string& key, const std::string& nearest) {
    return "a.yaml: " + key + ": is unknown, expected a known key, of which " + nearest + " is the nearest";
  };
  for (const auto& [key, nearest] : {std::pair<std::string, std::string>{"seem_rad", "seam_rad"},
                                     {"hues_dg", "hues_deg"},
                                     {"sigma_hues", "sigma_hues_deg"},
                                     {"seam", "seam_rad"},
                                     {"sigma_name", "name"}})
    EXPECT_EQ(complaint(key + ": 1"), unknown(key, nearest));
  EXPECT_EQ(complaint("nme: x\nseam_rad: 1\nhues: 2\ngap: 3"), unknown("nme", "name") + "; unknown too: hues, gap");
  EXPECT_EQ(complaint(std::string(100000, 'a') + ": 1").substr(0, 10), "a.yaml: is");  // YAML's keys are shorter
}

TEST(KnownKeys, RefusesWhatHidesSomething) {
  EXPECT_EQ(complaint("seam_rad: 1\nseam_rad: 2"), "a.yaml: seam_rad: is there twice, expected every key once");
  EXPECT_EQ(complaint("x: &x {seam_rad: 1}\n<<: *x").substr(0, 12), "a.yaml: x: i");
  EXPECT_EQ(complaint("<<: {seam_rad: 1}").substr(0, 23), "a.yaml: <<: is unknown,");
  EXPECT_EQ(complaint("? [a, b]\n: 1").substr(0, 21), "a.yaml: ?: is unknown");
  EXPECT_EQ(complaint("seam_rad:"), "a.yaml: seam_rad: is empty, expected a value, or no such key");
  EXPECT_EQ(complaint("seam_rad: ~"), "a.yaml: seam_rad: is empty, expected a value, or no such key");
  EXPECT_EQ(complaint("sigma_seam_rad: 1"), "a.yaml: sigma_seam_rad: is alone, expected seam_rad beside it");
  for (const char* sigma : {"-1", "nan", "x", "[1, -2]", "{data: [1, .inf]}"})
    EXPECT_NE(complaint(std::string("seam_rad: 1\nsigma_seam_rad: ") + sigma), "") << sigma;
  EXPECT_NE(complaint("seam_rad: 1\nsigma_seam_rad: &a [*a]"), "") << "a list of itself";
}

}  // namespace lapservo::internal::known_keys_test
