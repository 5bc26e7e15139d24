"""plot_tip.py RUN GOAL.csv TIP_MM PLOT.png: the tip of a simulated run of servo beside its goal, across the line of sight.

RUN: the folder of --out; GOAL.csv: its --trajectory; TIP_MM: from the marker's proximal end to a straight tool's tip.
"""

import csv
import pathlib
import sys

import matplotlib
import numpy as np

import lapservo

matplotlib.use("Agg")
from matplotlib import pyplot

if len(sys.argv) != 5:
    sys.exit(__doc__)
run, goal_file, tip_m, plot = pathlib.Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]) / 1000, sys.argv[4]


def table(path, *columns):
    with open(path) as file:
        return np.array([[float(row[column] or "nan") for column in columns] for row in csv.DictReader(file)])


true_rig = run / "true_rig.yaml"  # where it differs from the loop's
camera_from_rcm = lapservo.Rig.load(true_rig if true_rig.exists() else run / "rig.yaml").instruments[0].camera_from_rcm
with open(run / "log.csv") as log:
    goes_on = np.array([row["action"] != "hold" for row in csv.DictReader(log)])
time_s, theta, phi, rho_m = table(run / "log.csv", "time_s", "true_theta_rad", "true_phi_rad", "true_rho_m").T
trajectory_s = np.append(0, np.cumsum(np.diff(time_s) * goes_on[:-1]))  # which stands in a hold
axis = np.stack([np.sin(phi) * np.cos(theta), np.sin(phi) * np.sin(theta), np.cos(phi)])
tip = camera_from_rcm[:3, :3] @ ((rho_m + tip_m) * axis) + camera_from_rcm[:3, 3:]
knots = table(goal_file, "time_s", "x_m", "y_m", "z_m").T
goal = np.stack([np.interp(trajectory_s, knots[0], axis) for axis in knots[1:]])

steady = (time_s > 4) & np.isfinite(tip[0])
sight = goal / np.linalg.norm(goal, axis=0)
off = tip - goal
depth = np.sum(sight * off, axis=0)
across = np.linalg.norm(off - sight * depth, axis=0)
print(f"from 4 s on: {1000 * np.sqrt(np.mean(across[steady] ** 2)):.2f} mm rms across the line of sight, "
      f"{1000 * np.sqrt(np.mean(depth[steady] ** 2)):.2f} mm along it")
figure, axes = pyplot.subplots(figsize=(5, 5))
axes.plot(1000 * tip[0], 1000 * tip[1], label="tip")
axes.plot(1000 * knots[1], 1000 * knots[2], ".", markersize=4, label="goal")
(left, top), (right, bottom) = 1000 * goal[:2].min(1) - 2, 1000 * goal[:2].max(1) + 2
axes.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal", xlim=(left, right), ylim=(top, bottom))
axes.invert_yaxis()  # as in the image
axes.legend()
figure.tight_layout()
figure.savefig(plot)
