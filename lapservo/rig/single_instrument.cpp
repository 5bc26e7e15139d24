#include "lapservo/rig/single_instrument.h"

#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::internal {

Rig first_instrument(Rig rig, const std::string& source) {
  if (rig.instruments.empty()) throw InputError(source, "has no instruments, expected one");
  rig.instruments.resize(1);
  return rig;
}

Rig single_instrument(Rig rig, const std::string& source) {
  rig = first_instrument(std::move(rig), source);
  if (!rig.instruments[0].camera_from_rcm)
    throw InputError(source, "instruments[0].camera_from_rcm", "missing",
                     "a transform: lapservo calibrate registration measures it");
  return rig;
}

}  // namespace lapservo::internal
