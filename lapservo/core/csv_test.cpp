#include "lapservo/core/csv.h"

#include <limits>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/has.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::csv_test {
using testing::input_error;

std::string parse_error(std::string_view text) {
  return input_error([&] { CsvTable::parse(text, "t.csv"); });
}

TEST(CsvTable, NumbersComeBackAsTheyWereWritten) {
  testing::SeededRandom random(13);
  std::vector<double> written;
  std::ostringstream text;
  text.precision(std::numeric_limits<double>::max_digits10);
  text << "x\n";
  for (int row = 0; row < 400; ++row)
    text << written.emplace_back(random.normal() * std::pow(10.0, random.uniform(-100, 100))) << '\n';
  const CsvTable table = CsvTable::parse(text.view(), "t.csv");
  ASSERT_EQ(table.rows(), written.size());
  for (std::size_t row = 0; row < table.rows(); ++row) EXPECT_EQ(table.number(row, "x"), written[row]);
}

TEST(CsvTable, ToleratesCarriageReturnsBlanksEmptyLinesAByteOrderMarkAndNoLastNewline) {
  const CsvTable table = CsvTable::parse(
      "\xEF\xBB\xBF"
      "name , x\r\n\r\nPSM1,\t1.5 \r\n\nPSM2,+2",
      "t.csv");
  ASSERT_EQ(table.rows(), 2U);
  EXPECT_TRUE(table.has("name"));
  EXPECT_TRUE(table.has("x"));
  EXPECT_FALSE(table.has("y"));
  EXPECT_EQ(table.text(0, "name"), "PSM1");
  EXPECT_EQ(table.number(0, "x"), 1.5);
  EXPECT_EQ(table.number(1, "x"), 2);
}

TEST(CsvTable, TextsComeBackAsTheyWereWritten) {
  constexpr std::string_view letters = "a,\" \t.";
  testing::SeededRandom random(17);
  for (int i = 0; i < 2000; ++i) {
    std::string first, second;
    for (std::string* text : {&first, &second})
      for (double length = random.uniform(0, 6); length > 0; --length) *text += letters[random.bits() % letters.size()];
    const CsvTable table = CsvTable::parse("x,y,z\n" + csv_field(first) + "," + csv_field(second) + ",end\n", "t.csv");
    EXPECT_EQ(table.text(0, "x"), first);
    EXPECT_EQ(table.text(0, "y"), second);
    EXPECT_EQ(table.text(0, "z"), "end");
  }
  EXPECT_EQ(csv_field("0001.png"), "0001.png");
  EXPECT_EQ(csv_field("a\nb"), "\"a\nb\"");
  EXPECT_EQ(input_error([] { csv_field(std::string_view("a\0b", 3)); }),
            "CSV: field: is a b, expected text without NUL bytes");
  EXPECT_EQ(csv_field("left, \"new\".png"), "\"left, \"\"new\"\".png\"");
  EXPECT_EQ(CsvTable::parse("x,y\n \"a,b\" , 2\r\n", "t.csv").text(0, "x"), "a,b");
}

// Names of files may hold line ends.
TEST(CsvTable, AQuotedFieldMayHoldLineEnds) {
  for (const std::string name : {"a\nb", "\n", "a\r\nb\n", "\"\n\",\n", "a\n\n\"b"}) {
    const CsvTable table = CsvTable::parse("x,y\n" + csv_field(name) + ",1\n2,z\n", "t.csv");
    ASSERT_EQ(table.rows(), 2U);
    EXPECT_EQ(table.text(0, "x"), name);
    EXPECT_EQ(table.text(1, "y"), "z");
  }
  EXPECT_EQ(input_error([] { CsvTable::parse("x,y\n\"a\nb\",1\n2\n", "t.csv"); }),
            "t.csv:4: has 1 fields, expected 2 as the header has");
}

TEST(CsvTable, AnEmptyFieldIsUnknownNotZero) {
  const CsvTable table = CsvTable::parse("a,b,c\n1,,\n", "t.csv");
  EXPECT_EQ(table.number_or_empty(0, "a"), 1);
  EXPECT_EQ(table.number_or_empty(0, "b"), std::nullopt);
  EXPECT_EQ(table.number_or_empty(0, "c"), std::nullopt);
  EXPECT_EQ(input_error([&] { table.number(0, "b"); }), "t.csv:2: b: is empty, expected a finite number");
}

TEST(CsvTable, ComplaintsNameFileLineColumnValueAndExpectation) {
  EXPECT_EQ(parse_error(""), "t.csv: is empty, expected a CSV file with a header line");
  EXPECT_EQ(parse_error("\n \r\n"), "t.csv: is empty, expected a CSV file with a header line");
  EXPECT_EQ(parse_error("a,b\n1,2\n\n3\n"), "t.csv:4: has 1 fields, expected 2 as the header has");
  EXPECT_EQ(parse_error("# mine\na,b\n1,2\n"),
            "t.csv:2: has 2 fields, expected 1 as the header has, which is a comment: remove it");
  EXPECT_EQ(parse_error("a,b\n1,2,3\n"), "t.csv:2: has 3 fields, expected 2 as the header has");
  EXPECT_EQ(parse_error(std::string_view("a,b\n1,\0\n", 8)), "t.csv: holds NUL bytes, expected CSV text");
  for (const char* row : {"\"a,2", "\"a\"b,2", "1,\"", "1,\"\"\"", "1,\"2\" 3"})
    EXPECT_EQ(parse_error(std::string("x,y\n") + row + "\n"), "t.csv:2: has a quote that does not end with its field")
        << row;
  for (const char* text : {"time_s;yaw\n0,5;1,2\n", "time_s\tyaw\n0.5\t1.2\n"})
    EXPECT_TRUE(testing::has(parse_error(text), "t.csv:1: separates columns by semicolons")) << text;
  const CsvTable table = CsvTable::parse("a,b\n1,2\n\nfast,nan\n", "t.csv");
  EXPECT_EQ(input_error([&] { table.number(1, "a"); }), "t.csv:4: a: is fast, expected a finite number");
  EXPECT_EQ(input_error([&] { table.number_or_empty(1, "b"); }), "t.csv:4: b: is nan, expected a finite number");
  EXPECT_EQ(input_error([&] { table.text(0, "c"); }), "t.csv: has no column 'c', expected one beside a,b");
}

TEST(CsvTable, AColumnThatStandsThereTwiceIsRefusedWhenItIsAskedFor) {
  const CsvTable table = CsvTable::parse("a,b,note,b,note,,\n1,2,x,3,y,,\n", "t.csv");
  EXPECT_EQ(table.number(0, "a"), 1);
  EXPECT_EQ(input_error([&] { table.number(0, "b"); }), "t.csv: has several columns 'b', expected one");
  EXPECT_EQ(input_error([&] { table.text(0, "note"); }), "t.csv: has several columns 'note', expected one");
}

TEST(ParseFinite, TakesTheWholeTextAsOneFiniteNumberOrNothing) {
  EXPECT_EQ(parse_finite("-1.5e-3"), -1.5e-3);
  EXPECT_EQ(parse_finite("+7"), 7);
  EXPECT_EQ(parse_finite("7."), 7);
  for (const char* text : {"", "+", "-", "+-7", "++7", " 7", "7 ", "7m", "1,5", "0x10", "inf", "-inf", "nan", "1e999"})
    EXPECT_EQ(parse_finite(text), std::nullopt) << "'" << text << "'";
}

}  // namespace lapservo::internal::csv_test
