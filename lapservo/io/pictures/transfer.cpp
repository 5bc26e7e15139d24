#include "lapservo/io/pictures/transfer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <fmt/format.h>

#include "lapservo/geometry/response.h"

namespace lapservo::internal {
namespace {

// Rec. 2100, light of the scene; 1 is the peak.
double hlg_light(double value) {
  constexpr double a = 0.17883277, b = 1 - 4 * a;
  const double c = 0.5 - a * std::log(4 * a);
  return value <= 0.5 ? value * value / 3 : (std::exp((value - c) / a) + b) / 12;
}

// SMPTE ST 2084, in cd/m2.
double pq_light(double value) {
  constexpr double m1 = 2610.0 / 16384, m2 = 2523.0 / 32, c1 = 3424.0 / 4096, c2 = 2413.0 / 128, c3 = 2392.0 / 128;
  const double root = std::pow(value, 1 / m2);
  return 10000 * std::pow(std::max(root - c1, 0.0) / (c2 - c3 * root), 1 / m1);
}

double light_of(double value, const Transfer& transfer) {
  constexpr double hlg_white = 0.75, pq_white = 203;
  switch (transfer.kind) {
    case Transfer::Kind::power:
      return std::pow(value, transfer.gamma);
    case Transfer::Kind::hlg:
      return hlg_light(value) / hlg_light(hlg_white);
    case Transfer::Kind::pq:
      return pq_light(value) / pq_white;
  }
  return value;
}

}  // namespace

std::optional<Transfer> transfer_of_code(int code) {
  constexpr int linear = 8, pq = 16, hlg = 18;
  if (code == hlg) return Transfer{Transfer::Kind::hlg};
  if (code == pq) return Transfer{Transfer::Kind::pq};
  return code == linear ? std::optional(Transfer{}) : std::nullopt;
}

std::string name_of(const std::optional<Transfer>& transfer) {
  if (!transfer) return "a camera's";
  if (transfer->kind == Transfer::Kind::hlg) return "HLG";
  if (transfer->kind == Transfer::Kind::pq) return "PQ";
  return transfer->gamma == 1 ? "linear light" : fmt::format("gamma {:.2f}", transfer->gamma);
}

std::string remark_on_transfer(const Transfer& transfer) {
  return fmt::format("names {}: its light is read as sRGB", name_of(transfer));
}

cv::Mat srgb_of(const cv::Mat& bgr16, const Transfer& transfer) {
  constexpr std::size_t values = 65536;
  const Response srgb;
  std::vector<std::uint8_t> table(values);
  for (std::size_t i = 0; i < values; ++i) {
    const double light = light_of(static_cast<double>(i) / (values - 1), transfer);
    table[i] = static_cast<std::uint8_t>(std::lround(255 * srgb.value_from_light(std::min(light, 1.0))));
  }
  cv::Mat bgr(bgr16.size(), CV_8UC3);
  for (int v = 0; v < bgr.rows; ++v)
    std::transform(bgr16.ptr<std::uint16_t>(v), bgr16.ptr<std::uint16_t>(v) + 3 * bgr.cols, bgr.ptr(v),
                   [&](std::uint16_t value) { return table[value]; });
  return bgr;
}

}  // namespace lapservo::internal
