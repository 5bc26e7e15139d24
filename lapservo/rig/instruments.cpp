#include "lapservo/rig/instruments.h"

#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::internal {

Rig first_instrument(Rig rig, const std::string& source) {
  if (rig.instruments.empty()) throw InputError(source, "has no instruments, expected one");
  rig.instruments.resize(1);
  return rig;
}

void require_registration(const Rig& rig, const std::string& source) {
  if (!rig.instruments.at(0).camera_from_rcm)
    throw InputError(source, "instruments[0].camera_from_rcm", "missing",
                     "a transform: lapservo calibrate registration measures it");
}

Rig single_instrument(Rig rig, const std::string& source) {
  rig = first_instrument(std::move(rig), source);
  require_registration(rig, source);
  return rig;
}

Rig without_sigmas(Rig rig) {
  rig.camera.sigmas = {}, rig.camera.covariance.reset();
  rig.camera.response.sigma.reset(), rig.camera.response.sigma_light.clear(), rig.camera.response.sigma_value.clear();
  for (Instrument& instrument : rig.instruments) {
    instrument.sigma_translation_m.reset(), instrument.sigma_quaternion_xyzw.reset();
    instrument.registration_covariance.reset(), instrument.sigma_image_delay_s.reset();
    instrument.marker.sigmas = {};
    if (instrument.joints) instrument.joints->sigma_offset.reset();
  }
  return rig;
}

std::optional<std::size_t> instrument_index(const Rig& rig, std::string_view name) {
  for (std::size_t i = 0; i < rig.instruments.size(); ++i)
    if (rig.instruments[i].name == name) return i;
  return std::nullopt;
}

std::size_t named_instrument(const Rig& rig, const std::optional<std::string>& name, const std::string& rig_name,
                             const std::string& option) {
  if (!name && rig.instruments.size() > 1)
    throw InputError(rig_name, "has several instruments: name one with " + option);
  const auto index = name ? instrument_index(rig, *name) : 0;
  if (!index) throw InputError(option, "name", *name, "an instrument of " + rig_name);
  return *index;
}

}  // namespace lapservo::internal
