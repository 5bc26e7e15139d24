"""own_robot.py RIG.yaml: ten seconds of the loop around an arm, a camera and a clock of one's own, all simulated here."""

import sys

import numpy as np

import lapservo


class Arm(lapservo.Robot):
    """Goes where it is sent with a lag of 30 ms. With a real arm, a thread samples the path."""

    def __init__(self, q):
        super().__init__()
        self.q, self.time_s, self.path = np.array(q), 0.0, None

    def state(self):
        return lapservo.JointState(self.time_s, self.q)

    def send(self, path):
        self.path = path

    def advance(self, dt_s):
        self.time_s += dt_s
        if self.path is not None:
            self.q = self.q + (self.path.at(self.time_s)[0] - self.q) * (1 - np.exp(-dt_s / 0.03))


class Camera(lapservo.ImageStream):
    """30 images a second of where the arm is, 50 ms late."""

    def __init__(self, rig, arm):
        super().__init__()
        self.renderer, self.arm, self.exposed, self.on_the_way = lapservo.Renderer(rig), arm, 0, []

    def expose(self):
        if 30 * self.arm.time_s >= self.exposed:
            self.exposed += 1
            self.on_the_way.append((self.arm.time_s, self.arm.q))

    def newest(self):
        if not self.on_the_way or self.arm.time_s < self.on_the_way[0][0] + 0.05:
            return None
        return self.arm.time_s, self.renderer.render(self.on_the_way.pop(0)[1], seed=self.exposed)


class Clock(lapservo.Clock):
    """The arm's time passes while the loop sleeps. With a real arm this is lapservo.SteadyClock."""

    def __init__(self, arm, camera):
        super().__init__()
        self.arm, self.camera = arm, camera

    def now_s(self):
        return self.arm.time_s

    def sleep_until(self, time_s):
        while self.arm.time_s < time_s - 1e-9:
            self.arm.advance(min(0.002, time_s - self.arm.time_s))
            self.camera.expose()


if len(sys.argv) != 2:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[1])
arm = Arm([0.05, 1.57, 0.064, 1.2])
camera = Camera(rig, arm)
errors = []


def on_tick(tick):
    if tick.error is not None and tick.time_s > 9:
        errors.append(np.abs(tick.error))


limits = [-1, 0.6, 0.03, -4], [1, 2.5, 0.2, 4], [0.4, 0.4, 0.04, 1.5], [2, 2, 0.2, 7.5]  # positions, rate, acceleration
controller = lapservo.Controller(rig, joint_limits=limits)
lapservo.run(arm, camera, Clock(arm, camera), rig, lapservo.paper_trajectory(), 10, controller=controller, on_tick=on_tick)
s, r, l, d = np.max(errors, axis=0)
print(f"largest errors in the last second: s {1000 * s:.2f} mrad; r {r:.2f}, l {l:.2f}, d {d:.2f} px")
sys.exit(0 if s < 0.005 and max(r, l, d) < 1 else 1)
