"""plot_q.py INPUT RIG.yaml PLOT.png: the first instrument's configuration over time, with one sigma."""

import sys

import matplotlib
import numpy as np

import lapservo

matplotlib.use("Agg")
from matplotlib import pyplot

if len(sys.argv) != 4:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[2])
tracker = lapservo.Tracker(rig, frame_budget=None)
rows = []
for frame in lapservo.open_frames(sys.argv[1], deinterlaced=rig.camera.deinterlace):
    seen = tracker.track(frame)[0]
    if seen.q is not None and seen.q_covariance is not None:
        rows.append(np.concatenate([[frame.time_s], seen.q, np.sqrt(np.diag(seen.q_covariance))]))
if not rows:
    sys.exit("no frame shows the instrument, or the rig has no camera_from_rcm")
table = np.array(rows)
table[:, 4] = np.unwrap(table[:, 4])  # psi, which is measured in (-pi, pi], over whole turns
figure, axes = pyplot.subplots(4, 1, sharex=True, figsize=(7, 8))
for i, name in enumerate(["theta [rad]", "phi [rad]", "rho [m]", "psi [rad]"]):
    axes[i].errorbar(table[:, 0], table[:, 1 + i], table[:, 5 + i], fmt=".-")
    axes[i].set_ylabel(name)
axes[3].set_xlabel("time [s]")
figure.tight_layout()
figure.savefig(sys.argv[3])
