"""Readings as topics of ROS 2, over DDS, without ROS; see `manytouch.sinks.ros2.messages` for the topics.

A message is made only where it is read. A message on NAME/tare (std_msgs/Empty) requests a tare, one on
NAME/undo_tare the reference before it.
"""

import math
import os
import re
import time
from collections.abc import Callable

from manytouch.errors import ManytouchError, OutputError
from manytouch.pipeline import Controls
from manytouch.sinks.publishers.address import OutputAddress
from manytouch.sinks.publishers.dds import DdsParticipant
from manytouch.sinks.publishers.images import ImageTurns, encoded_image
from manytouch.sinks.recorder import started_unix_ns
from manytouch.sinks.ros2.messages import UNKNOWN_SCALE, Mount, RosMessage, RosMessages
from manytouch.values import Reading, Sensor, Tare, UndoTare

NAME = "manytouch"
FRAME_NAME = r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*"
DIAGNOSTICS_INTERVAL_S = 1.0
TOPICS = {
    "wrench": "geometry_msgs/msg/WrenchStamped",
    "contacts": "sensor_msgs/msg/PointCloud2",
    "surface": "sensor_msgs/msg/PointCloud2",
    "contact_markers": "visualization_msgs/msg/MarkerArray",
    "image/compressed": "sensor_msgs/msg/CompressedImage",
    "camera_info": "sensor_msgs/msg/CameraInfo",
}
MOST_TARES = 100  # that wait and are taken at once


class Ros2Publisher:
    """Publishes the readings of a session."""

    def __init__(self, address: OutputAddress, controls: Controls) -> None:
        """Join the domain and announce the topics.

        Args:
            address: `ros2://NAME?domain=N&images=RATE`; absent: manytouch, ROS_DOMAIN_ID or 0, and
                `IMAGES_PER_S`. `parent=FRAME&pose=X,Y,Z,RX,RY,RZ` adds the pose of the sheet in another
                frame, in mm and rad (rotation vector).
            controls: the session; it gets the requests of tares.

        Raises:
            ManytouchError: name, domain, pose or rate of images is wrong.
            OutputError: the domain cannot be joined.
            MissingExtraError: cyclonedds or rosbags is not installed.
        """
        name, domain, self._mount, self._turns = settings(address)
        self._name, self._controls = name, controls
        self._messages = RosMessages(controls.sensor, name, self._mount)
        try:
            self._dds = DdsParticipant(domain)
        except OSError as error:
            raise OutputError(f"{address.text!r}: {error}") from error
        for topic, type_name in TOPICS.items():
            self._dds.declare(self._messages.topic(topic), type_name)
        self._dds.declare("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        self._dds.declare("/tf_static", "tf2_msgs/msg/TFMessage", is_latched=True)
        requests = (self._messages.topic(name) for name in ("tare", "undo_tare"))
        self._tare, self._undo_tare = (self._dds.reader(topic, "std_msgs/msg/Empty") for topic in requests)
        self._epoch_ns: int | None = None
        self._next_diagnostics_s = 0.0
        self._dds.write(self._messages.transform(time.time_ns()))
        topics = ", ".join(self._messages.topic(topic) for topic in TOPICS)
        self.description = (
            f"publishes {topics}, /diagnostics and /tf_static in the ROS domain {domain}; a message "
            f"on {self._messages.topic('tare')} requests a tare, on {self._messages.topic('undo_tare')} the "
            "reference before"
        )
        if controls.sensor.length_unit != "mm":
            self.description += f"; {UNKNOWN_SCALE}"

    def publish(self, reading: Reading) -> None:
        """Publish what of a reading is read."""
        if self._tare.take(N=MOST_TARES):
            self._controls.send(Tare())
        if self._undo_tare.take(N=MOST_TARES):
            self._controls.send(UndoTare())
        frame = reading.frame
        if self._epoch_ns is None:
            self._epoch_ns = started_unix_ns(frame)
        stamp_ns = self._epoch_ns + frame.timestamp_ns
        if self._messages.sensor is not self._controls.sensor:
            self._messages = RosMessages(self._controls.sensor, self._name, self._mount)
            self._dds.write(self._messages.transform(stamp_ns))
        messages = self._messages
        self._send("wrench", lambda: messages.wrench(reading, stamp_ns))
        self._send("contacts", lambda: messages.contacts(reading, stamp_ns))
        self._send("surface", lambda: messages.surface(reading, stamp_ns))
        self._send("contact_markers", lambda: messages.markers(reading, stamp_ns))
        is_read = self._is_read("image/compressed") or self._is_read("camera_info")
        if is_read and self._turns.take(frame):
            self._send("image/compressed", lambda: messages.image(*self._turns.encoded(frame), stamp_ns))
            if not self._controls.sensor.camera.views:
                self._send("camera_info", lambda: messages.camera_info(stamp_ns))
        if time.monotonic() >= self._next_diagnostics_s:
            self._next_diagnostics_s = time.monotonic() + DIAGNOSTICS_INTERVAL_S
            self._dds.write(messages.diagnostics(self._controls.health(), reading.status, stamp_ns))

    def close(self) -> None:
        """Leave the domain."""
        self._tare = self._undo_tare = None
        self._dds.close()

    def _send(self, topic: str, make: Callable[[], RosMessage]) -> None:
        if self._is_read(topic):
            self._dds.write(make())

    def _is_read(self, topic: str) -> bool:
        return self._dds.is_read(self._messages.topic(topic))


def settings(address: OutputAddress) -> tuple[str, int, Mount | None, ImageTurns]:
    """Name, domain, pose and images that an address requests; nothing is opened.

    Raises:
        ManytouchError: one of them is wrong.
    """
    name = "/".join(part for part in (address.host, address.path) if part) or NAME
    if not re.fullmatch(FRAME_NAME, name):
        raise ManytouchError(f"{address.text!r}: {name!r} is not a name of ROS: use letters, digits and _")
    domain = address.number("domain", _domain_of_environment(), (0.0, 232.0))
    return name, round(domain), mount_of(address), ImageTurns(address)


def warm_up(reading: Reading, sensor: Sensor) -> tuple[RosMessage, ...]:
    """All messages of a reading."""
    messages = RosMessages(sensor)
    return (
        messages.wrench(reading, 0),
        messages.contacts(reading, 0),
        messages.surface(reading, 0),
        messages.markers(reading, 0),
        messages.image(*encoded_image(reading.frame), 0),
        *(() if sensor.camera.views else (messages.camera_info(0),)),
    )


def mount_of(address: OutputAddress) -> Mount | None:
    """The pose of the sheet in another frame, from `parent` and `pose`; None without them.

    Raises:
        ManytouchError: one of them is absent or wrong.
    """
    parent, text = address.options.get("parent"), address.options.get("pose")
    if parent is None and text is None:
        return None
    try:
        numbers = [float(word) for word in (text or "").split(",")]
    except ValueError:
        numbers = []
    if (
        not re.fullmatch(FRAME_NAME, parent or "")
        or len(numbers) != 6
        or not all(map(math.isfinite, numbers))
    ):
        raise ManytouchError(
            f"{address.text!r}: expected parent=FRAME&pose=X,Y,Z,RX,RY,RZ with the pose of the sheet in that "
            "frame, in mm and rad (rotation vector)"
        )
    return Mount(parent=parent or "", translation_mm=tuple(numbers[:3]), rotation_vector=tuple(numbers[3:]))


def _domain_of_environment() -> float:
    text = os.environ.get("ROS_DOMAIN_ID", "0")
    return float(text) if text.isdecimal() else 0.0
