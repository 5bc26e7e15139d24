#include "lapservo/io/pictures/picture_order.h"

#include <algorithm>
#include <compare>
#include <cstddef>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

constexpr std::string_view digits = "0123456789", points = ".,", signs = "+-";

bool is_one_of(std::string_view letters, std::string_view text, std::size_t at) {
  return at < text.size() && letters.find(text[at]) != std::string_view::npos;
}

// A number and the text before it: digits, and decimals as they stand there. The last one of a name has
// none.
struct Part {
  std::string text;
  bool has_number = false, is_negative = false;
  std::string whole, decimals;
};

// How the names of a folder are read.
struct Reading {
  bool has_decimals = false;
  std::set<std::string> signed_places;  // texts up to a number with a sign, # for each number in them
};

std::string_view digits_at(std::string_view name, std::size_t at) {
  return name.substr(at, std::min(name.find_first_not_of(digits, at), name.size()) - at);
}

// Digits after the one point of "12.5"; none of "1.2.3" and "12".
std::string_view decimals_at(std::string_view name, std::size_t at) {
  const bool follows_another = at >= 2 && is_one_of(points, name, at - 1) && is_one_of(digits, name, at - 2);
  const std::size_t point = at + digits_at(name, at).size();
  if (follows_another || !is_one_of(points, name, point) || !is_one_of(digits, name, point + 1)) return {};
  const std::string_view decimals = digits_at(name, point + 1);
  const std::size_t end = point + 1 + decimals.size();
  return is_one_of(points, name, end) && is_one_of(digits, name, end + 1) ? std::string_view() : decimals;
}

std::vector<Part> parts_of(const std::string& name, const Reading& reading) {
  std::vector<Part> parts;
  std::string place;
  for (std::size_t at = 0; at <= name.size();) {
    const std::size_t number = std::min(name.find_first_of(digits, at), name.size());
    Part part{name.substr(at, number - at), number < name.size(), false, {}, {}};
    place += part.text;
    if (part.has_number && reading.signed_places.contains(place)) {
      part.is_negative = part.text.back() == '-';
      part.text.pop_back();
    }
    part.whole = digits_at(name, number);
    if (reading.has_decimals) part.decimals = decimals_at(name, number);
    at =
        number + part.whole.size() + (part.decimals.empty() ? 0 : 1 + part.decimals.size()) + (part.has_number ? 0 : 1);
    place += '#';
    parts.push_back(std::move(part));
  }
  return parts;
}

std::set<std::string> places_in(const std::string& name, bool has_decimals) {
  std::set<std::string> places;
  std::string place;
  for (const Part& part : parts_of(name, {has_decimals, {}})) {
    place += part.text;
    if (part.has_number) places.insert(place);
    place += '#';
  }
  return places;
}

bool ends_in_sign(const std::string& place) {
  return !place.empty() && is_one_of(signs, place, place.size() - 1);
}

Reading reading_of(const std::vector<std::string>& names) {
  std::set<std::size_t> counts;
  bool any_ends_in_zero = false;
  for (const std::string& name : names)
    for (const Part& part : parts_of(name, {true, {}})) {
      if (!part.decimals.empty()) counts.insert(part.decimals.size());
      any_ends_in_zero = any_ends_in_zero || (part.decimals.size() > 1 && part.decimals.back() == '0');
    }
  Reading reading{counts.size() < 2 || !any_ends_in_zero, {}};
  std::set<std::string> places;
  for (const std::string& name : names) places.merge(places_in(name, reading.has_decimals));
  for (const std::string& place : places)
    if (ends_in_sign(place) && (place.size() == 1 || places.contains(place.substr(0, place.size() - 1))))
      reading.signed_places.insert(place);
  return reading;
}

std::strong_ordering by_value(const Part& a, const Part& b) {
  const auto digits_of = [](const Part& part) {
    const std::size_t first = std::min(part.whole.find_first_not_of('0'), part.whole.size());
    const std::size_t end = part.decimals.find_last_not_of('0') + 1;
    return std::pair(part.whole.substr(first), part.decimals.substr(0, end));
  };
  const auto [whole_a, decimals_a] = digits_of(a);
  const auto [whole_b, decimals_b] = digits_of(b);
  if (whole_a.size() != whole_b.size()) return whole_a.size() <=> whole_b.size();
  return std::pair(whole_a, decimals_a) <=> std::pair(whole_b, decimals_b);
}

std::strong_ordering by_number(const Part& a, const Part& b) {
  if (a.has_number != b.has_number) return a.has_number <=> b.has_number;
  if (a.is_negative != b.is_negative) return b.is_negative <=> a.is_negative;
  return a.is_negative ? by_value(b, a) : by_value(a, b);
}

struct Named {
  fs::path file;
  std::vector<Part> parts;
};

bool comes_before(const Named& a, const Named& b) {
  for (std::size_t i = 0; i < std::min(a.parts.size(), b.parts.size()); ++i) {
    if (a.parts[i].text != b.parts[i].text) return a.parts[i].text < b.parts[i].text;
    if (const auto order = by_number(a.parts[i], b.parts[i]); order != std::strong_ordering::equal) return order < 0;
  }
  return a.file.filename() < b.file.filename();
}

std::vector<fs::path> sorted(const std::vector<fs::path>& files, const Reading& reading) {
  std::vector<Named> named;
  for (const fs::path& file : files) named.push_back({file, parts_of(file.stem().string(), reading)});
  std::sort(named.begin(), named.end(), comes_before);
  std::vector<fs::path> order;
  for (Named& one : named) order.push_back(std::move(one.file));
  return order;
}

}  // namespace

PictureOrder ordered_pictures(std::vector<fs::path> files) {
  std::vector<std::string> names;
  for (const fs::path& file : files) names.push_back(file.stem().string());
  PictureOrder order{sorted(files, reading_of(names)), false};
  order.is_ambiguous = order.files != sorted(files, Reading{});
  return order;
}

}  // namespace lapservo::internal
