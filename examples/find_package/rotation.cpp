#include <cmath>
#include <cstdio>
#include <lapservo/io/image_file.h>
#include <lapservo/vision/tracker.h>

int main(int, char** argv) {
  const lapservo::Rig rig = lapservo::load_rig(argv[1]);  // configs/example.yaml
  lapservo::Tracker tracker(rig);
  for (const lapservo::Observation& seen : tracker.track(lapservo::read_image(argv[2])))
    if (seen.rcm)
      std::printf("psi = %.4f rad, sigma = %.4f rad\n", seen.rcm->q.psi_rad, std::sqrt(seen.rcm->covariance(3, 3)));
}
