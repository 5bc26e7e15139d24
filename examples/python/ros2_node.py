"""ros2_node.py RIG.yaml: a node of ROS 2 that publishes theta, phi, rho, psi of the instruments in /endoscope/image_raw."""

import sys

import lapservo
import numpy as np
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Image, JointState


def on_image(message):
    if message.encoding != "bgr8":
        return node.get_logger().error(f"the images are {message.encoding}, expected bgr8", throttle_duration_sec=1)
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    image = rows[:, : 3 * message.width].reshape(message.height, message.width, 3)
    stamp = message.header.stamp
    for seen in tracker.track(image, stamp.sec + 1e-9 * stamp.nanosec):
        if seen.q is None:
            node.get_logger().warning(f"{seen.instrument}: {seen.status.value}", throttle_duration_sec=1)
            continue
        publishers[seen.instrument].publish(
            JointState(header=message.header, name=["theta", "phi", "rho", "psi"], position=list(map(float, seen.q))))


if len(sys.argv) != 2:
    sys.exit(__doc__)
rclpy.init()
node = rclpy.create_node("lapservo_example")
rig = lapservo.Rig.load(sys.argv[1])
tracker = lapservo.Tracker(rig)
publishers = {i.name: node.create_publisher(JointState, f"/lapservo/{i.name}/q", 1) for i in rig.instruments}
node.create_subscription(Image, "/endoscope/image_raw", on_image, qos_profile_sensor_data)
rclpy.spin(node)
