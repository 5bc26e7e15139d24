#include "lapservo/core/known_keys.h"

#include <string>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal {
namespace {

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
  EXPECT_EQ(complaint("seem_rad: 1"),
            "a.yaml: seem_rad: is unknown, expected a known key, of which seam_rad is the nearest");
  EXPECT_EQ(complaint("hues_dg: 1"),
            "a.yaml: hues_dg: is unknown, expected a known key, of which hues_deg is the nearest");
  EXPECT_EQ(complaint("sigma_hues: 1"),
            "a.yaml: sigma_hues: is unknown, expected a known key, of which sigma_hues_deg is the nearest");
  EXPECT_EQ(complaint("seam: 1"), "a.yaml: seam: is unknown, expected a known key, of which seam_rad is the nearest");
  EXPECT_EQ(complaint("sigma_name: 1"),
            "a.yaml: sigma_name: is unknown, expected a known key, of which name is the nearest");
  EXPECT_EQ(complaint("nme: x\nseam_rad: 1\nhues: 2\ngap: 3"),
            "a.yaml: nme: is unknown, expected a known key, of which name is the nearest; unknown too: hues, gap");
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
}

}  // namespace
}  // namespace lapservo::internal
