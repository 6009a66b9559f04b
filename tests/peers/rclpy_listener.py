"""A node of ROS 2 that prints one line of JSON for each message; run by the Python of a venv with rclpy.

python rclpy_listener.py NAME SECONDS [tare]
"""

import json
import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, CompressedImage, PointCloud2
from std_msgs.msg import Empty

name, seconds = sys.argv[1], float(sys.argv[2])


def show(topic: str, **values: object) -> None:
    print(json.dumps({"topic": topic, **values}), flush=True)


def on_wrench(message: WrenchStamped) -> None:
    force, torque = message.wrench.force, message.wrench.torque
    stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    show(
        "wrench",
        frame=message.header.frame_id,
        stamp_ns=stamp,
        force=[force.x, force.y, force.z],
        torque=[torque.x, torque.y, torque.z],
    )


def on_cloud(topic: str, message: PointCloud2) -> None:
    numpy_types = {6: "<u4", 7: "<f4"}
    fields = [(field.name, numpy_types[field.datatype]) for field in message.fields]
    points = np.frombuffer(bytes(message.data), np.dtype(fields))
    show(topic, names=[field for field, _ in fields], points=[list(map(float, point)) for point in points])


rclpy.init()
node = rclpy.create_node("listener")
node.create_subscription(WrenchStamped, f"/{name}/wrench", on_wrench, qos_profile_sensor_data)
for cloud in ("contacts", "surface"):
    node.create_subscription(
        PointCloud2,
        f"/{name}/{cloud}",
        lambda message, cloud=cloud: on_cloud(cloud, message),
        qos_profile_sensor_data,
    )
node.create_subscription(
    CompressedImage,
    f"/{name}/image/compressed",
    lambda message: show("image", format=message.format, start=bytes(message.data[:3]).hex()),
    qos_profile_sensor_data,
)
node.create_subscription(
    CameraInfo,
    f"/{name}/camera_info",
    lambda message: show("camera_info", k=list(message.k), size=[message.width, message.height]),
    qos_profile_sensor_data,
)
tare = node.create_publisher(Empty, f"/{name}/tare", 1)
show("ready")
end = time.monotonic() + seconds
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
    if "tare" in sys.argv and tare.get_subscription_count():
        tare.publish(Empty())
node.destroy_node()
rclpy.shutdown()
