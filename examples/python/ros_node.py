"""ros_node.py RIG.yaml: a node of ROS 1 that publishes theta, phi, rho, psi of the instruments in /endoscope/image_raw."""

import sys

import lapservo
import numpy as np
import rospy
from sensor_msgs.msg import Image, JointState


def on_image(message):
    if message.encoding != "bgr8":
        return rospy.logerr_throttle(1, f"the images are {message.encoding}, expected bgr8")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    image = rows[:, : 3 * message.width].reshape(message.height, message.width, 3)
    for seen in tracker.track(image, message.header.stamp.to_sec()):
        if seen.q is None:
            rospy.logwarn_throttle(1, f"{seen.instrument}: {seen.status.value}")
            continue
        publishers[seen.instrument].publish(JointState(message.header, ["theta", "phi", "rho", "psi"], list(seen.q), [], []))


if len(sys.argv) != 2:
    sys.exit(__doc__)
rospy.init_node("lapservo_example")
rig = lapservo.Rig.load(sys.argv[1])
tracker = lapservo.Tracker(rig)
publishers = {i.name: rospy.Publisher(f"/lapservo/{i.name}/q", JointState, queue_size=1) for i in rig.instruments}
rospy.Subscriber("/endoscope/image_raw", Image, on_image, queue_size=1, buff_size=2**25)
rospy.spin()
