#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/vision/decision/instrument_memory.h"

namespace lapservo::internal::print_record_test {

using View = PrintRecord::View;

bool is_the_rigs(const PrintRecord& record, double tau_rad) {
  return record.known_sides()[print_side(tau_rad)];
}

// From two sides, each time it comes round, and not from behind.
TEST(PrintRecord, IsTheRigsWhereItWasSeenToBe) {
  PrintRecord record;
  record.add(1, View::the_rigs);
  EXPECT_FALSE(is_the_rigs(record, 1)) << "one side may be chance";
  record.add(1.01, View::the_rigs);
  EXPECT_FALSE(is_the_rigs(record, 1)) << "the same side";
  record.add(1.6, View::the_rigs);
  for (const double turns : {-1.0, 0.0, 2.0})
    for (const double tau_rad : {0.7, 1.0, 1.3, 1.6, 1.9}) {
      EXPECT_TRUE(is_the_rigs(record, tau_rad + two_pi * turns)) << tau_rad;
      EXPECT_FALSE(is_the_rigs(record, tau_rad + pi + two_pi * turns)) << tau_rad;
    }
  record.add(4, View::off);
  EXPECT_FALSE(is_the_rigs(record, 1.3)) << "the same print is off elsewhere";
  record.add(4, View::the_rigs);
  EXPECT_TRUE(is_the_rigs(record, 1.3)) << "the latest counts";
}

TEST(PrintRecord, IsForgottenWhenTheInstrumentMayHaveBeenExchanged) {
  PrintRecord record;
  record.begin_frame(100);
  for (const double tau_rad : {0.5, 1.0}) record.add(tau_rad, View::the_rigs);
  record.begin_frame(101);
  EXPECT_TRUE(is_the_rigs(record, 0.7));
  record.add(3, View::possible);
  record.begin_frame(102.5);
  EXPECT_TRUE(is_the_rigs(record, 0.7)) << "it was in sight";
  record.begin_frame(104);
  EXPECT_FALSE(is_the_rigs(record, 0.7));
}

TEST(PrintRecord, TheSeamIsNoBorder) {
  PrintRecord record;
  record.add(-0.2, View::the_rigs), record.add(0.2, View::the_rigs);
  EXPECT_TRUE(is_the_rigs(record, 0));
  EXPECT_TRUE(is_the_rigs(record, two_pi));
}

TEST(PrintRecord, IsOffFromSeveralSidesUnlessItMostlyIsTheRigs) {
  PrintRecord record;
  for (const double tau_rad : {1.1, 1.2, 2.0}) record.add(tau_rad, View::off);
  EXPECT_FALSE(record.is_off()) << "two sides";
  record.add(3, View::off);
  EXPECT_TRUE(record.is_off());
  record.add(4, View::the_rigs);
  EXPECT_TRUE(record.is_off()) << "a turn looks like it from there";
  record.add(5, View::possible);
  EXPECT_FALSE(record.is_off()) << "who knows";
}

TEST(PrintRecord, APictureThatCanNotTellIsNoNews) {
  PrintRecord record;
  record.add(1, View::the_rigs), record.add(1.6, View::the_rigs);
  for (const double tau_rad : {1.0, 1.6, 2.2}) record.add(tau_rad, View::possible);
  EXPECT_TRUE(is_the_rigs(record, 1.3));
  EXPECT_FALSE(is_the_rigs(record, 2.8)) << "near what could not show it, and one other";
}

}  // namespace lapservo::internal::print_record_test
