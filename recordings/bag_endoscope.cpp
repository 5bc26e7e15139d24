#include "recordings/bag_endoscope.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <variant>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/statistics.h"
#include "recordings/stamped_messages.h"

namespace lapservo::internal {
namespace {

struct Place {
  double time_s = 0;
  Rigid3 pose;
};

struct Way {
  double m = 0, rad = 0;
};
Way way_between(const Place& a, const Place& b) {
  return {(a.pose.translation - b.pose.translation).norm(), a.pose.rotation.angularDistance(b.pose.rotation)};
}

std::vector<Place> places_in(const Bag& bag, const BagTopic& topic) {
  constexpr double plain = 1e-3;  // the norm's rounding
  std::vector<Place> places;
  StampedMessages messages(bag.messages(topic));
  while (const auto message = messages.next()) {
    const Rigid3& pose = std::get<PlaceMessage>(message->message).pose;
    if (pose.translation.allFinite() && std::abs(pose.rotation.norm() - 1) < plain)
      places.push_back({message->time_s, {pose.rotation.normalized(), pose.translation}});
  }
  return places;
}

std::vector<Place> places_of_ecm(const Bag& bag) {
  for (const char* end : {"/ECM/local/measured_cp", "/ECM/measured_cp"})
    for (const BagTopic& topic : bag.topics())
      if (topic.type == place_type && topic.messages > 0 && topic.name.ends_with(end)) return places_in(bag, topic);
  return {};
}

// The most that poses of a place at rest are apart.
Way most_at_rest(const std::vector<Place>& places) {
  constexpr double least_m = 0.3e-3, least_rad = 2e-3, times = 3;  // of the median from pose to pose
  std::vector<double> steps_m, steps_rad;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const Way step = way_between(places[i - 1], places[i]);
    steps_m.push_back(step.m), steps_rad.push_back(step.rad);
  }
  return {least_m + times * median(steps_m), least_rad + times * median(steps_rad)};
}

}  // namespace

std::string endoscope_motion_text(const Bag& bag) {
  const std::vector<Place> places = places_of_ecm(bag);
  if (places.size() < 2) return "";
  const Way most = most_at_rest(places);
  const auto is_apart_from = [&](const Place& from) {
    return [&](const Place& place) {
      const Way way = way_between(from, place);
      return way.m > most.m || way.rad > most.rad;
    };
  };
  const auto left = std::ranges::find_if(places, is_apart_from(places.front()));
  if (left == places.end()) return "";
  const auto came = std::find_if(places.rbegin(), places.rend(), is_apart_from(places.back()));
  Way farthest;
  for (const Place& place : places) {
    const Way way = way_between(places.front(), place);
    farthest = {std::max(farthest.m, way.m), std::max(farthest.rad, way.rad)};
  }
  const double begin_s = places.front().time_s, left_s = left->time_s - begin_s;
  return fmt::format("the endoscope moved by {:.1f} mm and {:.1f} mrad between {:.1f} and {:.1f} s", 1e3 * farthest.m,
                     1e3 * farthest.rad, left_s,
                     came == places.rend() ? left_s : std::max(left_s, came->time_s - begin_s));
}

}  // namespace lapservo::internal
