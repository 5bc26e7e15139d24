#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "fuzz/require.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/rig/rig.h"

// Any text is a rig that can be used over the largest circle amid its image and every rotation, or an InputError.
namespace lapservo::internal::rig_fuzz {
using fuzz::require;

void require_usable(const Camera& camera) {
  const Eigen::Vector2d middle(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
  constexpr int steps = 4;
  for (int i = -steps; i <= steps; ++i)
    for (int j = -steps; j <= steps; ++j) {
      const Eigen::Vector2d part = Eigen::Vector2d(i, j) / steps;
      const Eigen::Vector2d raw = middle + middle.cwiseProduct(part);
      const auto ideal = camera.ideal_from_raw(raw);
      const bool in_circle = (raw - middle).norm() < middle.minCoeff();
      require(ideal || !in_circle, "every pixel of the largest circle amid the image has a ray");
      if (!ideal) continue;
      require(ideal->allFinite(), "rays are finite");
      require((camera.raw_from_ideal(*ideal) - raw).norm() < 1e-3, "distortion and its inverse cancel");
    }
  for (const float light : camera.response.table()) require(light >= 0 && light <= 1, "light is between 0 and 1");
}

void require_usable(const Instrument& instrument) {
  const CrossRatioDecoder decoder(instrument.marker);
  for (const double tau_rad : {0.1, 2.0, 4.0, 6.2}) {
    const double decoded_rad = decoder.tau_rad(cross_ratio_at(instrument.marker, tau_rad));
    require(std::abs(decoded_rad - tau_rad) < 1e-3, "every rotation can be decoded");
  }
  if (!instrument.camera_from_rcm) return;
  require(instrument.camera_from_rcm->translation.allFinite(), "the RCM is somewhere");
  require(std::abs(instrument.camera_from_rcm->rotation.norm() - 1) < 1e-9, "the RCM frame is orthonormal");
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  fuzz::read_or_refuse([&] {
    const Rig rig = parse_rig(text, "fuzz.yaml");
    require(!rig.instruments.empty(), "a rig has an instrument");
    require_usable(rig.camera);
    for (const Instrument& instrument : rig.instruments) require_usable(instrument);
  });
  return 0;
}

}  // namespace lapservo::internal::rig_fuzz
