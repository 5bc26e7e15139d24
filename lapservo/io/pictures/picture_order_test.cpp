#include "lapservo/io/pictures/picture_order.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::picture_order_test {

struct Folder {
  std::vector<const char*> in_order;
  bool is_ambiguous = false;
};

TEST(PictureOrder, IsThatOfTheNumbersInTheNames) {
  const std::vector<Folder> folders{{{"frame0", "frame1", "frame9", "frame10", "frame100"}},
                                    {{"frame08", "frame9", "frame010", "frame11"}},
                                    {{"1700000000123456789", "1700000000123456790", "17000000001234567890"}},
                                    {{"x", "x (1)", "x (2)", "x (10)", "y", "y (1)"}},
                                    {{"x", "x-1", "x-2", "x-10"}},
                                    {{"x", "x.1", "x.2", "x.10"}},
                                    {{"x", "x1", "x1b", "x2"}},
                                    {{"0.0", "0.25", "0.5", "1.0", "10.125"}, true},
                                    {{"t0,5", "t1,25", "t1,5"}, true},
                                    {{"0.040", "0.080", "0.120", "1.000"}},
                                    {{"shot2.9998", "shot2.9999", "shot2.10000", "shot2.10001"}},
                                    {{"v1.2.9", "v1.2.10", "v1.10.1"}},
                                    {{"12.30.59", "12.31.00"}},
                                    {{"2024-01-15", "2024-01-16", "2024-02-01"}},
                                    {{"-10", "-2", "-1.5", "-1", "0", "3", "20"}, true},
                                    {{"-3", "-2", "-1"}, true},
                                    {{"z-10", "z-5", "z0", "z5", "z10"}, true},
                                    {{"a_-1.5_b2", "a_-1.5_b10", "a_0_b1", "a_+0.5_b1"}, true},
                                    {{"frame-1", "frame-2", "frame-10"}}};
  for (const Folder& folder : folders) {
    std::vector<std::filesystem::path> files;
    for (const char* name : folder.in_order)
      files.push_back(std::filesystem::path("a folder") / (std::string(name) + ".png"));
    auto shuffled = files;
    std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(5));
    const PictureOrder order = ordered_pictures(shuffled);
    EXPECT_EQ(order.files, files) << folder.in_order[0];
    EXPECT_EQ(order.is_ambiguous, folder.is_ambiguous) << folder.in_order[0];
  }
}

}  // namespace lapservo::internal::picture_order_test
