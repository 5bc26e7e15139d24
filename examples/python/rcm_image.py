"""rcm_image.py INPUT RIG.yaml: where the incision's image is, from an instrument that swings about it."""

import sys

import lapservo

if len(sys.argv) != 3:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[2])
free = lapservo.Rig(rig.camera, [lapservo.Instrument(i.name, i.marker) for i in rig.instruments])
tracker = lapservo.Tracker(free, frame_budget=None)
seen = [tracker.track(frame)[0] for frame in lapservo.open_frames(sys.argv[1], deinterlaced=rig.camera.deinterlace)]
estimate = lapservo.estimate_rcm(seen)
if estimate.point_px is None:
    sys.exit(f"no estimate: {estimate.status}")
u, v = estimate.point_px
print(f"RCM at ({u:.1f}, {v:.1f}) px from {estimate.lines} positions")
