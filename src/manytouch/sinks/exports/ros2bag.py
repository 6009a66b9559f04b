"""A recording as a ROS 2 bag in MCAP, by rosbags."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from manytouch.errors import MissingExtraError
from manytouch.recording.reader import Recording
from manytouch.sinks.exports.readings import frames_of
from manytouch.sinks.ros2.messages import RosMessage, RosMessages, typestore
from manytouch.values.frame import image_format

VERSION: Literal[9] = 9  # of metadata.yaml; Jazzy writes it
INFINITE = (9223372036, 854775807)
"""Seconds and nanoseconds that ROS 2 takes as no limit."""


def _name(recording: Recording) -> str:
    """Name in topics and frames; each sensor of a rig has its own, so that their bags can run together."""
    sensor = recording.rig_sensor
    return "manytouch" if sensor is None else f"manytouch/{re.sub(r'[^A-Za-z0-9_]', '_', sensor)}"


def _latched() -> Any:
    """Quality of service of a message for late readers too; the player needs it stated to offer it."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    never = QosTime(*INFINITE)
    return Qos(
        history=QosHistory.KEEP_LAST,
        depth=1,
        reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL,
        deadline=never,
        lifespan=never,
        liveliness=QosLiveliness.AUTOMATIC,
        liveliness_lease_duration=never,
        avoid_ros_namespace_conventions=False,
    )


def write_ros2bag(recordings: Sequence[Recording], folder: Path) -> None:
    """Write the topics of `--to ros2://` of one recording, with its images as `sensor_msgs/CompressedImage`.

    Raises:
        MissingExtraError: rosbags is not installed.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
    except ImportError:
        raise MissingExtraError("ROS 2 bags", "rosbags", "connect") from None
    (recording,) = recordings
    messages = RosMessages(recording.sensor, _name(recording))
    begin_ns = int(recording.about["started_unix_ns"])
    with Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
        connections: dict[str, Any] = {}

        def put(message: RosMessage, stamp_ns: int) -> None:
            if message.topic not in connections:
                profiles = [_latched()] if message.topic == "/tf_static" else []
                connections[message.topic] = bag.add_connection(
                    message.topic, message.type, typestore=typestore(), offered_qos_profiles=profiles
                )
            bag.write(connections[message.topic], stamp_ns, message.cdr)

        put(messages.transform(begin_ns), begin_ns)
        for frame, reading in frames_of(recording):
            stamp_ns = begin_ns + frame.timestamp_ns
            if frame.encoded:
                put(messages.image(frame.encoded, image_format(frame.encoded), stamp_ns), stamp_ns)
                if not recording.sensor.camera.views:
                    put(messages.camera_info(stamp_ns), stamp_ns)
            if reading is not None:
                put(messages.wrench(reading, stamp_ns), stamp_ns)
                put(messages.contacts(reading, stamp_ns), stamp_ns)
                put(messages.surface(reading, stamp_ns), stamp_ns)
                put(messages.markers(reading, stamp_ns), stamp_ns)
