"""Recordings as calibrations want them, of a simulated arm, camera and board."""

import os
import subprocess

import numpy as np
from conftest import SOURCE

import lapservo

TOOL = os.environ["LAPSERVO_TOOL"]
FPS = 8
DELAY_S = 0.12


def scaled_rig(scale):
    """The paper's rig before a smaller camera, its joints known."""
    rig = lapservo.Rig.load(SOURCE / "configs" / "paper.yaml")
    camera, instrument = rig.camera, rig.instruments[0]
    matrix = np.diag([scale, scale, 1]) @ camera.matrix
    return lapservo.Rig(
        lapservo.Camera(int(scale * camera.width_px), int(scale * camera.height_px), matrix),
        [lapservo.Instrument("PSM1", instrument.marker, camera_from_rcm=instrument.camera_from_rcm, image_delay_s=DELAY_S,
                             joints=lapservo.Joints(["yaw", "pitch", "insertion", "roll"]))])


def joints_of(motion, frames, as_if_fps=FPS):
    times = np.arange(-0.5, frames / FPS + 0.5, 0.02)
    columns = dict(zip(("yaw", "pitch", "insertion", "roll"), np.array([motion(t) for t in times]).T))
    return {"time_s": times * FPS / as_if_fps - DELAY_S} | columns


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
        self.rig = scaled_rig(0.75)
        (folder / "rig.yaml").write_text(self.rig.to_yaml())

    def record(self, name, motion, frames, as_if_fps=FPS):
        """Pictures and joints; faster than the motion is where the pictures are said to come at another rate."""
        poses = self.folder / f"{name}.csv"
        poses.write_text("theta_rad,phi_rad,rho_m,psi_rad\n" + "".join(row(motion(i / FPS)) for i in range(frames)))
        subprocess.run([TOOL, "render", "--rig", self.folder / "rig.yaml", "--poses", poses, "--out", self.folder / name],
                       check=True, capture_output=True)
        joints = joints_of(motion, frames, as_if_fps)
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


def blurred(light, sigma_px):
    kernel = np.exp(-0.5 * (np.arange(-4, 5) / sigma_px) ** 2)
    rows = np.pad(light, ((4, 4), (0, 0)), "edge")
    across = np.pad(sum(w * rows[i:i + len(light)] for i, w in enumerate(kernel)), ((0, 0), (4, 4)), "edge")
    return sum(w * across[:, i:i + light.shape[1]] for i, w in enumerate(kernel)) / kernel.sum() ** 2


def board_picture(camera, camera_from_board, seed):
    """A board of 9 x 6 inner corners, 5 mm apart, blurred by a lens and encoded as sRGB."""
    over, blur_px = 3, 0.8
    squares_from_image = np.linalg.inv(camera.matrix @ camera_from_board[:3, [0, 1, 3]] @ np.diag([0.005, 0.005, 1]))
    v, u = (np.arange(over * n) / over - (1 - 1 / over) / 2 for n in (camera.height_px, camera.width_px))
    x, y, z = (a * u + b * v[:, None] + c for a, b, c in squares_from_image)
    column, line = np.floor(x / z), np.floor(y / z)
    on_board = (column >= -1) & (column < 9) & (line >= -1) & (line < 6)
    light = np.where(on_board & ((column + line) % 2 == 0), 0.04, 0.75)
    light = blurred(light.reshape(camera.height_px, over, camera.width_px, over).mean((1, 3)), blur_px)
    noise = np.random.default_rng(seed).normal(0, 0.004, (*light.shape, 3))
    light = np.clip(light[..., None] + noise, 0, 1)
    encoded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 0.0031308) ** (1 / 2.4) - 0.055)
    return np.round(255 * encoded).astype(np.uint8)


def tilted(about_x_rad, about_y_rad, x_m, y_m, z_m):
    (cx, sx), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (about_x_rad, about_y_rad))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    pose[:3, 3] = [x_m, y_m, z_m] - pose[:3, :3] @ [0.02, 0.0125, 0]
    return pose


BOARD_POSES = [(0.4, 0, 0, 0, 0.08), (-0.4, 0.1, 0.005, 0, 0.085), (0, 0.45, -0.005, 0.003, 0.08),
               (0.1, -0.45, 0, -0.003, 0.085), (0.3, 0.3, 0.004, 0.002, 0.078), (-0.3, -0.3, -0.004, -0.002, 0.09)]


def board_pictures(camera):
    return [board_picture(camera, tilted(*pose), seed) for seed, pose in enumerate(BOARD_POSES)]
