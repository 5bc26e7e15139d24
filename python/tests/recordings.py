"""Recordings as calibrations want them, of a simulated arm and camera."""

import os
import subprocess

import numpy as np
from conftest import SOURCE

import lapservo

TOOL = os.environ["LAPSERVO_TOOL"]
FPS = 8
DELAY_S = 0.12


def small_rig():
    """The paper's rig before a smaller camera, its joints known."""
    scale = 0.75
    rig = lapservo.Rig.load(SOURCE / "configs" / "paper.yaml")
    camera, instrument = rig.camera, rig.instruments[0]
    matrix = np.diag([scale, scale, 1]) @ camera.matrix
    return lapservo.Rig(
        lapservo.Camera(int(scale * camera.width_px), int(scale * camera.height_px), matrix),
        [lapservo.Instrument("PSM1", instrument.marker, camera_from_rcm=instrument.camera_from_rcm, image_delay_s=DELAY_S,
                             joints=lapservo.Joints(["yaw", "pitch", "insertion", "roll"]))])


def joints_of(motion, frames):
    times = np.arange(-0.5, frames / FPS + 0.5, 0.02)
    columns = dict(zip(("yaw", "pitch", "insertion", "roll"), np.array([motion(t) for t in times]).T))
    return {"time_s": times - DELAY_S} | columns


def swinging(t):
    return (0.22 * np.sin(0.9 * t), 1.57 + 0.18 * np.sin(1.3 * t + 1), 0.064 + 0.008 * np.sin(0.7 * t),
            3.3 * np.sin(0.6 * t + 2))


def turning(t):
    return 0.02 * np.sin(t), 1.57, 0.064, -3 + 1.05 * 2 * np.pi * t * FPS / 48


def row(values):
    return ",".join(repr(float(value)) for value in values) + "\n"


class Recordings:
    def __init__(self, folder):
        self.folder = folder
        self.rig = small_rig()
        (folder / "rig.yaml").write_text(self.rig.to_yaml())

    def record(self, name, motion, frames):
        """Images and joints."""
        poses = self.folder / f"{name}.csv"
        poses.write_text("theta_rad,phi_rad,rho_m,psi_rad\n" + "".join(row(motion(i / FPS)) for i in range(frames)))
        subprocess.run([TOOL, "render", "--rig", self.folder / "rig.yaml", "--poses", poses, "--out", self.folder / name],
                       check=True, capture_output=True)
        joints = joints_of(motion, frames)
        (self.folder / f"{name}_joints.csv").write_text(
            ",".join(joints) + "\n" + "".join(row(values) for values in zip(*joints.values())))
        return [frame.image for frame in lapservo.open_frames(self.folder / name)], joints

    def commanded(self, *arguments):
        out = self.folder / "commanded.yaml"
        subprocess.run([TOOL, "calibrate", *arguments, "--out", out], check=True, capture_output=True, cwd=self.folder)
        return out.read_bytes()

    def saved(self, result):
        out = self.folder / "saved.yaml"
        result.save(out)
        return out.read_bytes()
