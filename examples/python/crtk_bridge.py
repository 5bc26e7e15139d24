"""crtk_bridge.py ARM RIG.yaml: another robot as a CRTK arm over ROS 2, for `lapservo servo --robot ros2:ARM`, record and calibrate all.

Put your robot's own library in place of OtherRobot, which is simulated, and leave film() out if your camera is one that lapservo reads.
"""

import sys
import threading
import time

import numpy as np

import lapservo

#: The robot's units, degrees and millimetres, in one rad or m of the rig's joints: yaw, pitch, insertion, roll.
OWN_UNITS = np.array([180 / np.pi, 180 / np.pi, 1000, 180 / np.pi])


class OtherRobot:
    """Goes to its goal with a lag of 30 ms."""

    def __init__(self, joints):
        self.enabled, self.joints, self.goal, self.time_s = True, joints, joints, time.monotonic()

    def read(self):
        lag, self.time_s = self.time_s - time.monotonic(), time.monotonic()
        self.joints = self.joints + (self.goal - self.joints) * (1 - np.exp(lag / 0.03))
        return self.joints


def film(robot, rig, ended):
    """Publishes what a camera would see of the robot, some twenty images a second."""
    images, renderer, mounted = lapservo.Ros2ImagePublisher("/endoscope/image_raw"), lapservo.Renderer(rig), rig.instruments[0].joints
    while not ended.wait(0.03):
        exposed_s = time.time()
        q = mounted.offset + mounted.sign * robot.joints / OWN_UNITS
        images.publish(renderer.render(q, seed=int(1000 * exposed_s)), exposed_s)


def bridge(robot, arm):
    while True:
        for command in arm.new_commands():  # of operators; lapservo sends none
            robot.enabled = {"enable": True, "resume": True, "disable": False, "pause": False}.get(command, robot.enabled)
        setpoint = arm.new_setpoint()  # None while lapservo holds: the robot stays where it was sent
        if setpoint is not None and robot.enabled:
            robot.goal = np.array(setpoint) * OWN_UNITS
        if not robot.enabled:
            robot.goal = robot.joints
        state = "ENABLED" if robot.enabled else "PAUSED"  # FAULT after an emergency stop
        arm.publish(robot.read() / OWN_UNITS, robot.goal / OWN_UNITS, state, is_homed=True, is_busy=False)
        time.sleep(0.004)


if len(sys.argv) != 3:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[2])
robot = OtherRobot(np.array([0.05, 0.0, 0.08, 1.2]) * OWN_UNITS)
arm, ended = lapservo.Ros2Arm(sys.argv[1], rig.instruments[0].joints.names), threading.Event()
threading.Thread(target=film, args=(robot, rig, ended)).start()
print(f"{sys.argv[1]} and /endoscope/image_raw are there; Ctrl-C ends this", flush=True)
try:
    bridge(robot, arm)
except KeyboardInterrupt:
    pass
finally:
    ended.set()
