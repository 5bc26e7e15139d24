#include "lapservo/rig/single_instrument.h"

#include "lapservo/core/error.h"

namespace lapservo::internal {

Rig single_instrument(Rig rig, const std::string& source) {
  if (rig.instruments.empty()) throw InputError(source, "has no instruments, expected one");
  rig.instruments.resize(1);
  if (!rig.instruments[0].camera_from_rcm)
    throw InputError(source, "instruments[0].camera_from_rcm", "missing",
                     "a transform: the simulator needs to know where the instrument is");
  return rig;
}

}  // namespace lapservo::internal
