#include "lapservo/vision/camera/camera_look.h"

namespace lapservo::internal {
namespace {

// For an image that looks processed, or unlike any, through the departure.
bool looks_better(const ProcessingEvidence& as_the_rig_says, const ProcessingEvidence& departed) {
  if (as_the_rig_says.processing != Processing::found) return as_the_rig_says.processing == Processing::none;
  return !departed.edges || as_the_rig_says.edges->misfit_without < departed.edges->misfit_without;
}

struct CameraLook {
  const LightImage& light;
  std::span<const Measurement> measurements;
  double blur_px;

  ProcessingEvidence processing_in(const LightImage& seen, SeenCamera& camera) const {
    ProcessingEvidence evidence = find_processing(seen, measurements, blur_px);
    camera.explained += evidence.explained;
    return evidence;
  }
  void doubt_known(SeenCamera& camera) const {
    if (camera.departure.any() && looks_better(processing_in(light, camera), camera.evidence)) camera.departure = {};
  }
  void add(const CameraDeparture& more, SeenCamera& camera) const {
    const auto all = camera.departure.then(more);
    if (!all) return;
    const DepartedLight without(light, *all);
    if (!more.any() || processing_in(without.light(), camera).processing == Processing::none) camera.departure = *all;
  }
};

}  // namespace

SeenCamera look_at_camera(const LightImage& light, std::span<const Measurement> measurements, double blur_px,
                          const CameraDeparture& known) {
  SeenCamera camera{.departure = known};
  if (blur_px > processing_limits.max_blur_px) return camera;
  const CameraLook look{light, measurements, blur_px};
  const DepartedLight seen(light, known);
  const PooledEdges glance = glance_at(seen.light(), measurements);
  camera.evidence = find_processing(seen.light(), measurements, glance, blur_px);
  camera.explained += camera.evidence.explained;
  if (camera.evidence.processing != Processing::none) look.doubt_known(camera);
  const bool withdrawn = known.any() && !camera.departure.any();
  if (withdrawn || camera.evidence.processing == Processing::found) return camera;
  ++camera.asked_for_departure;
  const auto more = find_departure(seen.light(), measurements, glance, blur_px);
  if (more)
    look.add(*more, camera);
  else if (!known.any())
    camera.departure = {};  // what was uncertain is certain, where channels agree
  return camera;
}

}  // namespace lapservo::internal
