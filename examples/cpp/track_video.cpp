// track_video INPUT RIG.yaml: prints where the instruments are in a video, a folder of images or a camera.
#include <cstdio>
#include <lapservo/io/frame_source.h>
#include <lapservo/vision/tracker.h>

int main(int argc, char** argv) {
  if (argc != 3) return std::puts("track_video INPUT RIG.yaml"), 2;
  const lapservo::Rig rig = lapservo::load_rig(argv[2]);
  lapservo::Tracker tracker(rig, {.frame_budget = std::nullopt});
  const auto frames = lapservo::open_frame_source(argv[1], 30);
  while (const auto frame = frames->next()) {
    const auto& seen = frame->flaw ? tracker.refuse(*frame->flaw) : tracker.track(frame->bgr, frame->time_s);
    for (const lapservo::Observation& one : seen) {
      std::printf("%.3f s  %s: ", frame->time_s, one.instrument.c_str());
      if (one.status != lapservo::Status::ok || !one.rcm) {
        std::printf("%s\n", std::string(to_string(one.status)).c_str());
        continue;
      }
      const lapservo::JointVector& q = one.rcm->q;
      std::printf("%.4f %.4f rad, %.2f mm, %.4f rad\n", q.theta_rad, q.phi_rad, 1000 * q.rho_m, q.psi_rad);
    }
  }
}
