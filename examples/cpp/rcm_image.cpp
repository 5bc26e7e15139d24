// rcm_image INPUT RIG.yaml: where the incision's image is, from an instrument that swings about it.
#include <cstdio>
#include <lapservo/lapservo.h>
#include <vector>

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("rcm_image INPUT RIG.yaml"), 2;
  lapservo::Rig rig = lapservo::load_rig(argv[2]);
  for (lapservo::Instrument& instrument : rig.instruments)
    instrument.camera_from_rcm.reset();  // makes the tracker estimate the RCM
  lapservo::Tracker tracker(rig, {.frame_budget = std::nullopt});
  std::vector<lapservo::LineObservation> lines;
  const auto frames = lapservo::open_frame_source(argv[1], 30);
  while (const auto frame = frames->next()) {
    if (frame->flaw) continue;
    const lapservo::Observation& seen = tracker.track(frame->bgr).front();
    if (seen.status == lapservo::Status::ok)
      lines.push_back(lapservo::line_between(seen.edges_ideal_px[0], seen.edges_ideal_px[3], 1));
  }
  const lapservo::RcmEstimate rcm =
      lapservo::estimate_projected_rcm(lapservo::distinct_lines(lines), {.common_px = 0.01});
  if (rcm.status != lapservo::RcmStatus::ok) return 1;
  std::printf("RCM at (%.1f, %.1f) px from %zu positions\n", rcm.point_px.x(), rcm.point_px.y(), rcm.lines);
}
