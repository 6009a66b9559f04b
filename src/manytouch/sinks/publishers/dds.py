"""DDS by cyclonedds, as ROS 2 uses it: writers of ready CDR bytes, and readers.

ROS 2 maps the topic /a/b to the DDS topic rt/a/b, and geometry_msgs/msg/Wrench to
geometry_msgs::msg::dds_::Wrench_ (design.ros2.org, "Topic and Service name mapping to DDS").
"""

import time
from functools import cache
from typing import Any, cast

from manytouch.errors import MissingExtraError
from manytouch.sinks.ros2.messages import RosMessage, typestore

MATCHES_S = 0.1
"""How often readers are looked for, which takes as long as a message."""


@cache
def dds_type(name: str) -> Any:
    """The type of cyclonedds for a ROS 2 message.

    Its samples may have an attribute `cdr`, which is sent as it is.
    """
    from cyclonedds import idl

    fields = {field: _field_type(description) for field, description in typestore().fielddefs[name][1]}
    package, _, last = name.split("/")
    struct: Any = idl.make_idl_struct(last, f"{package}::msg::dds_::{last}_", fields)
    struct.serialize = _ready_bytes
    return struct


def _ready_bytes(sample: Any, **_: object) -> bytes:
    return sample.cdr  # type: ignore[no-any-return]


def _field_type(description: Any) -> Any:
    from cyclonedds.idl import types
    from rosbags.interfaces import Nodetype

    kind, content = description
    if kind == Nodetype.BASE:
        base = {"string": str, "bool": bool, "octet": types.uint8, "byte": types.uint8}
        return base[content[0]] if content[0] in base else getattr(types, content[0])
    if kind == Nodetype.NAME:
        return dds_type(content)
    element = _field_type(content[0])
    array, sequence = cast(Any, types.array), cast(Any, types.sequence)
    return array[element, content[1]] if kind == Nodetype.ARRAY else sequence[element]


class DdsParticipant:
    """A participant of a DDS domain that writes and reads topics of ROS 2."""

    def __init__(self, domain: int) -> None:
        """Join a domain; the environment variable CYCLONEDDS_URI selects the network.

        Raises:
            MissingExtraError: cyclonedds is not installed.
            OSError: the domain cannot be joined.
        """
        try:
            from cyclonedds.core import DDSException
            from cyclonedds.domain import DomainParticipant
        except ImportError:
            raise MissingExtraError("ROS 2", "cyclonedds", "connect") from None
        try:
            self._participant: Any = DomainParticipant(domain)
        except DDSException as error:
            raise OSError(f"DDS domain {domain} cannot be joined ({error})") from error
        self._writers: dict[str, Any] = {}
        self._is_read: dict[str, bool] = {}
        self._next_match_s: dict[str, float] = {}

    def declare(self, topic: str, type_name: str, *, is_latched: bool = False) -> None:
        """Announce a topic of sensor data (best effort, newest five), or a latched one (for late readers)."""
        from cyclonedds.pub import DataWriter

        self._writers[topic] = DataWriter(
            self._participant, self._topic(topic, type_name), _qos(is_latched=is_latched)
        )

    def is_read(self, topic: str) -> bool:
        """Whether there was a reader of a topic within the last `MATCHES_S`."""
        now_s = time.monotonic()
        if now_s >= self._next_match_s.get(topic, 0.0):
            self._next_match_s[topic] = now_s + MATCHES_S
            self._is_read[topic] = bool(self._writers[topic].get_matched_subscriptions())
        return self._is_read[topic]

    def write(self, message: RosMessage) -> None:
        """Send a message on a topic that was announced."""
        sample = object.__new__(dds_type(message.type))
        sample.cdr = message.cdr
        self._writers[message.topic].write(sample)

    def reader(self, topic: str, type_name: str, *, is_reliable: bool = True) -> Any:
        """A reader of a topic."""
        from cyclonedds.sub import DataReader

        found = _qos(is_latched=False, is_reliable=is_reliable)
        return DataReader(self._participant, self._topic(topic, type_name), found)

    def close(self) -> None:
        """Leave the domain."""
        self._writers.clear()
        self._participant = None

    def _topic(self, topic: str, type_name: str) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._participant, f"rt{topic}", dds_type(type_name))


def _qos(*, is_latched: bool, is_reliable: bool = False) -> Any:
    from cyclonedds.qos import Policy, Qos
    from cyclonedds.util import duration

    reliable = is_latched or is_reliable
    return Qos(
        Policy.Reliability.Reliable(duration(seconds=1)) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(1 if is_latched else 5),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    )
