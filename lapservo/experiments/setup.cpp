#include "lapservo/experiments/setup.h"

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

Rig without_registration(Rig rig) {
  for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
  return rig;
}

std::string method_title(Method method) {
  return method == Method::centerline ? "the paper\u2019s method" : "the default";
}

std::string method_word(Method method) {
  return method == Method::centerline ? "centerline" : "surface";
}

int method_color(Method method) {
  return method == Method::centerline ? 1 : 0;
}

}  // namespace lapservo::internal
