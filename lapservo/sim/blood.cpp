#include "lapservo/sim/blood.h"

#include "lapservo/core/angles.h"

namespace lapservo::internal {

std::vector<Blotch> blood_over(const Marker& marker, double fraction, Random& random) {
  constexpr double alone = 0.8;
  std::vector<Blotch> discs;
  for (double covered = 0; covered < fraction;) {
    const double radius_m = random.uniform(0.08, 0.25) * marker.diameter_m;
    discs.push_back({random.uniform(0, two_pi), random.uniform(0, marker.length_m()), radius_m});
    covered += alone * radius_m * radius_m / (marker.diameter_m * marker.length_m());
  }
  return discs;
}

}  // namespace lapservo::internal
