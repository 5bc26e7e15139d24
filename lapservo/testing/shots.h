#pragma once

#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::scenes {

/// Looks at the usual shots of the seeds 1 to `last`, each for itself; a failure names the seed.
template <typename Look>
void for_each_shot(std::uint64_t last, const Look& look) {
  for (std::uint64_t seed = 1; seed <= last; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    look(usual_shot(seed));
  }
}

}  // namespace lapservo::scenes
