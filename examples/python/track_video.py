"""track_video.py INPUT RIG.yaml: prints where the instruments are in a video, a folder of images or a camera."""

import sys

import lapservo

if len(sys.argv) != 3:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[2])
tracker = lapservo.Tracker(rig, frame_budget=None)
for frame in lapservo.open_frames(sys.argv[1], deinterlaced=rig.camera.deinterlace):
    for seen in tracker.track(frame):
        if seen.q is None:
            print(f"{frame.time_s:.3f} s  {seen.instrument}: {seen.status.value}")
            continue
        theta, phi, rho, psi = seen.q
        print(f"{frame.time_s:.3f} s  {seen.instrument}: {theta:.4f} {phi:.4f} rad, {1000 * rho:.2f} mm, {psi:.4f} rad")
