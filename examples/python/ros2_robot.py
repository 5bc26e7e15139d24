"""ros2_robot.py ARM RIG.yaml JOINT_LIMITS.yaml SECONDS [--enable-motion]: keeps an arm over ROS 2 at its first measured place."""

import sys

import numpy as np

import lapservo

if len(sys.argv) < 5:
    sys.exit(__doc__)
rig = lapservo.Rig.load(sys.argv[2])
clock = lapservo.SteadyClock()
controller = lapservo.Controller(rig, period_s=1 / 120, joint_limits=sys.argv[3])
images = lapservo.Ros2Camera("/endoscope/image_raw", rig, clock)
robot = lapservo.Ros2Robot(sys.argv[1], rig, controller, clock, enable_motion="--enable-motion" in sys.argv)
goal = lapservo.Kinematics(rig).features(robot.state().q)
if goal is None:
    sys.exit("the camera does not see the instrument where its joints say that it is")
errors = []


def on_tick(tick):
    if tick.error is not None:
        errors.append(np.abs(tick.error))


lapservo.run(robot, images, clock, rig, lapservo.set_point(goal), float(sys.argv[4]), controller=controller,
             own_thread=True, on_tick=on_tick)
if not errors:
    sys.exit(f"no image shows the instrument: {images.complaint or robot.state().blocked}")
s, r, l, d = errors[-1]
print(f"errors at the end: s {1000 * s:.2f} mrad; r {r:.2f}, l {l:.2f}, d {d:.2f} px")
