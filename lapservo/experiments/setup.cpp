#include "lapservo/experiments/setup.h"

namespace lapservo::internal {

Rig without_registration(Rig rig) {
  for (Instrument& instrument : rig.instruments) instrument.camera_from_rcm.reset();
  return rig;
}

std::string method_title(Method method) {
  return method == Method::centerline ? "the paper\u2019s method" : "the default";
}

int method_colour(Method method) {
  return method == Method::centerline ? 1 : 0;
}

}  // namespace lapservo::internal
