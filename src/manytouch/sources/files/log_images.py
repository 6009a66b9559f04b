"""Images in the messages of other programs: Foxglove's schemas and those of ROS 2."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from manytouch.errors import MissingExtraError
from manytouch.limits import MAX_MESSAGE_BYTES, size_mistake
from manytouch.values.arrays import Image, read_only

CODECS = {"h264": "h264", "h265": "hevc", "vp9": "vp9", "av1": "libdav1d"}
"""Formats of foxglove.CompressedVideo, and the decoders of FFmpeg."""

_CHANNELS = {
    **dict.fromkeys(("mono8", "8UC1", "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"), 1),
    **dict.fromkeys(("bgr8", "rgb8", "8UC3"), 3),
    **dict.fromkeys(("bgra8", "rgba8", "8UC4"), 4),
    **dict.fromkeys(("mono16", "16UC1"), 1),
}
CAN_BE_DECODED = (
    "JPEG, PNG, raw images of mono8, mono16, bgr8, rgb8, bgra8 or rgba8, or of Foxglove compressed video of "
    f"{', '.join(CODECS)}"
)
_TWO_BYTES = ("mono16", "16UC1")
"""Encodings with 16 bits per pixel."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LogImage:
    """An image of a message: its bytes as JPEG or PNG, or decoded, or neither if it cannot be decoded.

    Attributes:
        time_ns: time in the message, in ns from the origin of the clock of the program that wrote it, usually
            that of Unix; 0 if it has none.
        encoded: JPEG or PNG.
        image: (h, w) grey or (h, w, 3) BGR, uint8, or uint16 of the encodings mono16 and 16UC1. The pixels of
            a Bayer pattern are returned as they are, as a grey image without interpolation of the colours.
        is_predicted: as of a frame.
    """

    time_ns: int
    encoded: bytes | None = None
    image: Image | None = None
    is_predicted: bool = False


ImageDecoder = Callable[[bytes], Iterator[LogImage]]
"""Returns the images of a message; those of a video may come with a later message.

It raises MissingExtraError if a package that it needs is not installed.
"""


def decoder_of(schema: str, encoding: str) -> Callable[[], ImageDecoder] | None:
    """The function that creates a decoder for the messages of one channel; None if they are not images.

    Each channel needs a decoder of its own: that of a video keeps the frames before.

    Args:
        schema: name of the schema, such as "sensor_msgs/msg/Image".
        encoding: of the messages: "protobuf" or "cdr".
    """
    return _DECODERS.get((schema, encoding))


class _Video:
    """Decodes foxglove.CompressedVideo: one frame of an H.264, H.265, VP9 or AV1 stream per message."""

    def __init__(self) -> None:
        self._codec: Any = None
        self._times_ns: list[int] = []

    def __call__(self, data: bytes) -> Iterator[LogImage]:
        try:
            import av
            from av.error import FFmpegError
        except ImportError:
            raise MissingExtraError("compressed video", "av") from None
        message = _foxglove("CompressedVideo").FromString(data)
        name = CODECS.get(str(message.format).lower())
        time_ns = message.timestamp.ToNanoseconds()
        if name is None:
            yield LogImage(time_ns=time_ns)
            return
        if self._codec is None:
            self._codec = av.CodecContext.create(name, "r")
            self._codec.thread_count = 1  # with more, frames come later
        self._times_ns.append(time_ns)
        try:
            frames = self._codec.decode(av.Packet(bytes(message.data)))
        except FFmpegError:
            yield LogImage(time_ns=self._times_ns.pop())
            return
        for frame in frames:
            time_ns = self._times_ns.pop(0) if self._times_ns else time_ns
            fits = size_mistake(frame.width, frame.height) is None
            image = read_only(frame.to_ndarray(format="bgr24")) if fits else None
            yield LogImage(time_ns=time_ns, image=image, is_predicted=True)


def _foxglove_image(data: bytes) -> Iterator[LogImage]:
    message = _foxglove("CompressedImage").FromString(data)
    yield LogImage(time_ns=message.timestamp.ToNanoseconds(), encoded=bytes(message.data) or None)


def _foxglove_raw(data: bytes) -> Iterator[LogImage]:
    message = _foxglove("RawImage").FromString(data)
    image = _raw_image(message.encoding, message.width, message.height, message.step, message.data)
    yield LogImage(time_ns=message.timestamp.ToNanoseconds(), image=image)


def _ros_compressed(data: bytes) -> Iterator[LogImage]:
    message = _ros_message(data, "sensor_msgs/msg/CompressedImage")
    yield LogImage(time_ns=_ros_time_ns(message), encoded=message.data.tobytes() or None)


def _ros_raw(data: bytes) -> Iterator[LogImage]:
    message = _ros_message(data, "sensor_msgs/msg/Image")
    image = _raw_image(message.encoding, message.width, message.height, message.step, message.data)
    if image is not None and message.is_bigendian and image.dtype == np.uint16:
        image = read_only(image.byteswap())
    yield LogImage(time_ns=_ros_time_ns(message), image=image)


_DECODERS: dict[tuple[str, str], Callable[[], ImageDecoder]] = {
    ("foxglove.CompressedVideo", "protobuf"): _Video,
    ("foxglove.CompressedImage", "protobuf"): lambda: _foxglove_image,
    ("foxglove.RawImage", "protobuf"): lambda: _foxglove_raw,
    ("sensor_msgs/msg/CompressedImage", "cdr"): lambda: _ros_compressed,
    ("sensor_msgs/msg/Image", "cdr"): lambda: _ros_raw,
}


def _foxglove(name: str) -> Any:
    """A message class of foxglove-schemas-protobuf."""
    from importlib import import_module

    return getattr(import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)


def _ros_message(data: bytes, type_name: str) -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("ROS 2 messages", "rosbags", "connect") from None
    return get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, type_name)


def _ros_time_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def _raw_image(encoding: str, width_px: int, height_px: int, step: int, data: Any) -> Image | None:
    """A grey or BGR image from rows of `step` bytes; None if its encoding or size is not known."""
    channels = _CHANNELS.get(encoding)
    if channels is None or min(width_px, height_px) < 1 or size_mistake(width_px, height_px) is not None:
        return None
    kind = np.dtype(np.uint16 if encoding in _TWO_BYTES else np.uint8)
    content = np.frombuffer(bytes(data), np.uint8)
    row_bytes = width_px * channels * kind.itemsize
    if step < row_bytes or step * height_px > min(len(content), MAX_MESSAGE_BYTES):
        return None
    rows = content[: step * height_px].reshape(height_px, step)[:, :row_bytes]
    image = np.ascontiguousarray(rows).view(kind).reshape(height_px, width_px, channels)
    if channels == 1:
        return read_only(image[..., 0])
    colours = image[..., :3] if encoding.startswith(("bgr", "8UC")) else image[..., 2::-1]
    return read_only(np.ascontiguousarray(colours))
