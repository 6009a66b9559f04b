"""A node of ROS 2 that prints one line of JSON for each message; run by the Python of a venv with rclpy.

python rclpy_listener.py NAME SECONDS [tare]

NAME is that of the topics, such as skin for ros2://skin. Of the surface, every tenth message is
printed. With the word tare, it requests a tare each second.
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

try:
    from diagnostic_msgs.msg import DiagnosticArray
    from visualization_msgs.msg import MarkerArray
except ImportError:  # these packages are optional
    DiagnosticArray = MarkerArray = None

NUMPY_TYPES = {6: "<u4", 7: "<f4"}
try:
    name, seconds = sys.argv[1], float(sys.argv[2])
except (IndexError, ValueError):
    sys.exit("usage: python rclpy_listener.py NAME SECONDS [tare], such as rclpy_listener.py skin 20")
surfaces = 0


def show(topic: str, **values: object) -> None:
    print(json.dumps({"topic": topic, **values}), flush=True)


def stamp_ns(message) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def on_wrench(message: WrenchStamped) -> None:
    force, torque = message.wrench.force, message.wrench.torque
    show(
        "wrench",
        frame=message.header.frame_id,
        stamp_ns=stamp_ns(message),
        force=[force.x, force.y, force.z],
        torque=[torque.x, torque.y, torque.z],
    )


def on_cloud(topic: str, message: PointCloud2) -> None:
    fields = [(field.name, NUMPY_TYPES[field.datatype]) for field in message.fields]
    points = np.frombuffer(bytes(message.data), np.dtype(fields))
    show(
        topic,
        stamp_ns=stamp_ns(message),
        names=[field for field, _ in fields],
        points=[list(map(float, point)) for point in points],
    )


def on_surface(message: PointCloud2) -> None:
    global surfaces  # noqa: PLW0603
    if surfaces % 10 == 0:
        on_cloud("surface", message)
    surfaces += 1


def on_markers(message) -> None:
    tips = [[each.points[1].x, each.points[1].y, each.points[1].z] for each in message.markers if each.points]
    show("contact_markers", actions=[int(each.action) for each in message.markers], tips=tips)


def on_diagnostics(message) -> None:
    (status,) = message.status
    show("diagnostics", message=status.message, values={each.key: each.value for each in status.values})


rclpy.init()
node = rclpy.create_node("listener")


def listen(kind, topic: str, on_message) -> None:
    node.create_subscription(kind, topic, on_message, qos_profile_sensor_data)


listen(WrenchStamped, f"/{name}/wrench", on_wrench)
listen(PointCloud2, f"/{name}/contacts", lambda message: on_cloud("contacts", message))
listen(PointCloud2, f"/{name}/surface", on_surface)
listen(
    CompressedImage,
    f"/{name}/image/compressed",
    lambda message: show("image", format=message.format, start=bytes(message.data[:3]).hex()),
)
listen(
    CameraInfo,
    f"/{name}/camera_info",
    lambda message: show("camera_info", k=list(message.k), size=[message.width, message.height]),
)
if MarkerArray is not None:
    listen(MarkerArray, f"/{name}/contact_markers", on_markers)
    listen(DiagnosticArray, "/diagnostics", on_diagnostics)
tare = node.create_publisher(Empty, f"/{name}/tare", 1) if "tare" in sys.argv else None
show("ready")
next_tare = time.monotonic()
end = next_tare + seconds
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.1)
    if tare is not None and tare.get_subscription_count() and time.monotonic() > next_tare:
        tare.publish(Empty())  # the first one may come before the reader has found the node
        next_tare = time.monotonic() + 1.0
node.destroy_node()
rclpy.shutdown()
