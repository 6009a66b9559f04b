"""Images that other programs have recorded, as a source: MCAP files and ROS 2 bags.

A name may end in `#TOPIC`, where a file has images on several topics.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from manytouch.errors import MissingExtraError, SourceError
from manytouch.recording import PROFILE
from manytouch.recording.records import opened
from manytouch.sources.encoded import decoded
from manytouch.sources.files.log_images import CAN_BE_DECODED, LogImage, decoder_of
from manytouch.sources.source import Capabilities, evenly_timed_ns
from manytouch.values import Frame

METADATA = "metadata.yaml"  # of a bag of ROS 2
MAGIC = b"\x89MCAP0\r\n"
FIRST_MESSAGES = 300  # in which an image is expected that can be decoded


@dataclass(frozen=True, slots=True, kw_only=True)
class LogTopic:
    """A topic with images.

    Attributes:
        name: such as "/camera/image".
        schema, encoding: of its messages.
        count: number of messages; None if it is not known.
    """

    name: str
    schema: str
    encoding: str
    count: int | None


class LogSource:
    """The images of a topic, at the times of their messages; each iteration opens the file again.

    Attributes:
        path: an MCAP file, or the folder of a bag.
        topic: that is read.
        width_px, height_px: of the first image; others become frames without an image.
    """

    def __init__(self, path: Path, topic: LogTopic, fps: float | None = None) -> None:
        """Decode the first image.

        Args:
            path: see the attribute.
            topic: see the attribute.
            fps: rate that the timestamps follow instead of those of the messages.

        Raises:
            SourceError: no image can be decoded.
        """
        self.path, self.topic, self._fps = path, topic, fps
        self._shape: tuple[int, ...] = ()
        stamps_ns = []
        for place, frame in enumerate(self):
            stamps_ns.append(frame.timestamp_ns)
            if frame.image is not None and not self._shape:
                self._shape = frame.image.shape[:2]
            if place + 1 == FIRST_MESSAGES or (self._shape and place >= 10):
                break
        if not self._shape:
            raise SourceError(
                f"none of the first {len(stamps_ns)} images on {topic.name} in {str(path)!r} can be decoded: "
                f"record or convert them to {CAN_BE_DECODED}"
            )
        self.height_px, self.width_px = self._shape
        steps = sorted(end - begin for begin, end in pairwise(stamps_ns))
        middle_ns = steps[len(steps) // 2] if steps else 0
        self._own_fps = 1e9 / middle_ns if middle_ns > 0 else None

    @property
    def name(self) -> str:
        return self.path.stem

    @property
    def fps(self) -> float | None:
        """As given, else from the median step between the first frames."""
        return self._own_fps if self._fps is None else self._fps

    @property
    def frame_count(self) -> int | None:
        return self.topic.count

    @property
    def is_live(self) -> bool:
        return False

    @property
    def capabilities(self) -> Capabilities:
        files = sorted(self.path.iterdir()) if self.path.is_dir() else [self.path]
        return Capabilities(files=tuple(file for file in files if file.is_file()))

    def __iter__(self) -> Iterator[Frame]:
        first_ns: int | None = None
        last_ns = -1
        for index, (logged_ns, image) in enumerate(self._images()):
            time_ns = image.time_ns or logged_ns
            first_ns = time_ns if first_ns is None else first_ns
            last_ns = max(time_ns - first_ns, last_ns + 1)
            timestamp_ns = last_ns if self._fps is None else evenly_timed_ns(index, self._fps)
            frame = Frame(
                index=index,
                timestamp_ns=timestamp_ns,
                camera=self.topic.name,
                image=image.image,
                encoded=image.encoded,
                is_predicted=image.is_predicted,
            )
            yield self._of_one_size(decoded(frame, is_colour=True))

    def _of_one_size(self, frame: Frame) -> Frame:
        """The frame, without an image that has another size than the first one."""
        if frame.image is None or not self._shape or frame.image.shape[:2] == self._shape:
            return frame
        return replace(frame, image=None)

    def _images(self) -> Iterator[tuple[int, LogImage]]:
        """Log times and images."""
        make = decoder_of(self.topic.schema, self.topic.encoding)
        if make is None:
            return
        decode = make()
        for logged_ns, data in _messages(self.path, self.topic.name):
            try:
                for image in decode(data):
                    yield logged_ns, image
            except (MissingExtraError, GeneratorExit):
                raise
            except Exception:  # noqa: BLE001 - a damaged message is a frame without an image
                yield logged_ns, LogImage(time_ns=0)


def is_log(path: Path) -> bool:
    """Whether a path is an MCAP file of another program, or a bag of ROS 2.

    Raises:
        SourceError: it cannot be read.
    """
    if path.is_dir():
        return (path / METADATA).is_file()
    if path.suffix.lower() != ".mcap" or not path.is_file():
        return False
    with opened(path) as file:
        head = file.read(len(MAGIC) + 9 + 4 + len(PROFILE))
    is_whole = head.startswith(MAGIC) and head[len(MAGIC) : len(MAGIC) + 1] == b"\x01"
    return is_whole and not head.endswith(PROFILE.encode())


def log_source(path: Path, topic: str | None, fps: float | None = None) -> LogSource:
    """The images of an MCAP file of another program or of a bag of ROS 2.

    Args:
        path: the file or the folder.
        topic: to read; None: the only one with images.
        fps: see `LogSource`.

    Raises:
        SourceError: it has no images, or images on several topics, or none on this one.
        MissingExtraError: rosbags is not installed.
    """
    topics = [each for each in _topics(path) if decoder_of(each.schema, each.encoding) is not None]
    listed = ", ".join(each.name for each in topics)
    if not topics:
        raise SourceError(
            f"{str(path)!r} has no images: topics with foxglove.CompressedVideo, CompressedImage or "
            "RawImage, or sensor_msgs/CompressedImage or Image are read"
        )
    if topic is None and len(topics) > 1:
        raise SourceError(
            f"{str(path)!r} has images on several topics ({listed}): append one to the name, such as "
            f"'{path}#{topics[0].name}'"
        )
    found = next((each for each in topics if topic in (None, each.name)), None)
    if found is None:
        raise SourceError(f"{str(path)!r} has no images on the topic {topic}: choose one of {listed}")
    return LogSource(path, found, fps)


def _topics(path: Path) -> list[LogTopic]:
    if path.is_dir():
        with _bag(path) as bag:
            return [
                LogTopic(name=each.topic, schema=each.msgtype, encoding="cdr", count=each.msgcount)
                for each in bag.connections
            ]
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except McapError as error:
        raise SourceError(f"{str(path)!r} cannot be read ({error}): it is damaged") from error
    if summary is None:
        raise SourceError(f"{str(path)!r} has no summary: run mcap recover on it")
    counts = {} if summary.statistics is None else summary.statistics.channel_message_counts
    return [
        LogTopic(
            name=channel.topic,
            schema=summary.schemas[channel.schema_id].name if channel.schema_id in summary.schemas else "",
            encoding=channel.message_encoding,
            count=counts.get(channel.id),
        )
        for channel in summary.channels.values()
    ]


def _messages(path: Path, topic: str) -> Iterator[tuple[int, bytes]]:
    """Log times and contents of the messages of a topic."""
    if path.is_dir():
        with _bag(path) as bag:
            connections = [each for each in bag.connections if each.topic == topic]
            for _, logged_ns, data in bag.messages(connections):
                yield logged_ns, bytes(data)
        return
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    with path.open("rb") as file:
        try:
            for _, _, message in make_reader(file, validate_crcs=True).iter_messages(topics=[topic]):
                yield message.log_time, bytes(message.data)
        except McapError:
            return  # the rest of the file is damaged


def _bag(path: Path) -> Any:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("ROS 2 bags", "rosbags", "connect") from None
    try:
        return AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY))
    except AnyReaderError as error:
        raise SourceError(f"{str(path)!r} cannot be read ({error}): it is damaged") from error
