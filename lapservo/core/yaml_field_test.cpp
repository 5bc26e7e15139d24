#include "lapservo/core/yaml_field.h"

#include <array>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"

namespace lapservo::internal::yaml_field_test {
using testing::input_error;

YamlField parse(const std::string& yaml) {
  return YamlField::parse(yaml, "a.yaml", "file of ours");
}

TEST(YamlField, KnowsWhereItStands) {
  const YamlField root = parse("a: {b: [1, {c: x}]}");
  const auto number_of = [](const YamlField& field) { return input_error([&] { field.number("a number"); }); };
  EXPECT_EQ(number_of(root), "a.yaml: file: is a map, expected a number");
  EXPECT_EQ(number_of(root["a"]["b"]), "a.yaml: a.b: is a list of 2, expected a number");
  EXPECT_EQ(number_of(root["a"]["b"].list("")[1]["c"]), "a.yaml: a.b[1].c: is x, expected a number");
  EXPECT_EQ(number_of(parse("a: 0,0084")["a"]), "a.yaml: a: is 0,0084, expected 0.0084, with a decimal point");
  EXPECT_EQ(number_of(parse("a: b,c")["a"]), "a.yaml: a: is b,c, expected a number");
  EXPECT_EQ(number_of(root["a"]["d"]), "a.yaml: a.d: is missing, expected a number");
  EXPECT_EQ(input_error([&] { root["a"]["d"]["e"]; }), "a.yaml: a.d: is missing, expected a map with 'e'");
}

TEST(YamlField, EntriesAreThoseOfTheMapInItsOrder) {
  std::vector<std::string> keys;
  std::vector<double> values;
  for (const auto& [key, value] : parse("z: 3\na: 1\nm: 2").entries("a map")) {
    keys.push_back(key);
    values.push_back(value.number("a number"));
    EXPECT_EQ(input_error([&field = value] { field.list("a list"); }),
              "a.yaml: " + key + ": is " + value.value_text() + ", expected a list");
  }
  EXPECT_EQ(keys, (std::vector<std::string>{"z", "a", "m"}));
  EXPECT_EQ(values, (std::vector<double>{3, 1, 2}));
  EXPECT_EQ(input_error([] { parse("[1, 2]").entries("a map of keys"); }),
            "a.yaml: file: is a list of 2, expected a map of keys");
  EXPECT_EQ(input_error([] { parse("# nothing").entries("a map of keys"); }),
            "a.yaml: file: is missing, expected a map of keys");
}

TEST(YamlField, OutlivesItsRoot) {
  EXPECT_EQ(parse("a: [4, 5]")["a"].numbers<2>("two numbers"), (std::array<double, 2>{4, 5}));
}

TEST(YamlField, NamesTheKindOfFileThatWasExpected) {
  EXPECT_EQ(input_error([] { parse(std::string(17, '[')); }), "a.yaml: nests more deeply than a file of ours does");
  EXPECT_EQ(input_error([] { parse(std::string(1, '\0') + std::string(17, '[')); }),
            "a.yaml: holds NUL bytes as images do, expected a file of ours");
  for (const char* text : {"a:\n\tb: 1\n\tc: 2\n", "a:\n  b:\xc2\xa0z\n  c: 2\n"})
    EXPECT_TRUE(testing::has(input_error([&] { parse(text); }),
                             "is not YAML: line 2 has a tab or a no-break space, write spaces; line "))
        << text;
  EXPECT_EQ(input_error([] { parse(std::string((1 << 20) + 1, ' ')); }),
            "a.yaml: is larger than 1 MiB, expected a file of ours");
  EXPECT_EQ(input_error([] { parse(std::string(16, '[') + std::string(16, ']')); }), "");
  std::string nested, ruler(3000, '-');
  for (int i = 0; i < 3000; ++i) nested += "- ";
  EXPECT_EQ(input_error([&] { parse(nested); }), "a.yaml: nests more deeply than a file of ours does");
  EXPECT_EQ(input_error([&] { parse("# " + ruler + "\na: 1"); }), "");
  for (const char* text : {"a: b: c", "a: [1, 2"})
    EXPECT_TRUE(input_error([&] { parse(text); }).starts_with("a.yaml: is not YAML: ")) << text;
}

// yaml-cpp 0.7's LoadAll never returns from the first two.
TEST(YamlField, WhatIsLeftOverBetweenDocumentsIsRefused) {
  for (const char* text : {", a", "a: 1\n--- b\n, c", "a: 1\n---\nb: 2", "a: 1\n---\nb: 2\n---\nc: 3"})
    EXPECT_NE(input_error([&] { parse(text); }), "") << text;
  for (const char* text : {"---\na: 1", "a: 1\n...\n", "# nothing", ""})
    EXPECT_EQ(input_error([&] { parse(text); }), "") << text;
}

}  // namespace lapservo::internal::yaml_field_test
