"""Images that other programs have recorded: MCAP of Foxglove, bags of ROS 2 written by rosbags."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap_protobuf.writer import Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

from clips import picture
from manytouch.cli.terminal.viewing import is_playback
from manytouch.errors import SourceError
from manytouch.session.results import result_name
from manytouch.sources import open_source

ENCODERS = {
    "libvpx-vp9": {"deadline": "realtime", "lag-in-frames": "0"},
    "libx264": {"tune": "zerolatency", "g": "3"},
    "libx265": {"tune": "zerolatency", "x265-params": "log-level=none"},
}
STEP_NS, BEGIN_NS = 40_000_000, 1_700_000_000 * 10**9


def images(count: int = 6) -> list[np.ndarray]:
    """Pictures of 60 x 80 px that become lighter, with a dark corner."""
    found = []
    for index in range(count):
        image = np.full((60, 80, 3), 60 + 20 * index, np.uint8)
        image[:20, :20] = 10
        found.append(image)
    return found


def jpeg(image: np.ndarray) -> bytes:
    return cv2.imencode(".jpg", image)[1].tobytes()


def encoded_frames(codec: str) -> list[bytes]:
    """One packet per picture."""
    context = av.CodecContext.create(codec, "w")
    context.width, context.height, context.pix_fmt, context.time_base = 80, 60, "yuv420p", Fraction(1, 25)
    context.max_b_frames = 0
    context.options = ENCODERS[codec]
    packets = []
    for image in images():
        packets += context.encode(av.VideoFrame.from_ndarray(image, format="bgr24"))
    packets += context.encode(None)
    return [bytes(packet) for packet in packets]


def mcap_file(path: Path, **topics: list) -> Path:
    """A file with a message per image on each topic."""
    with path.open("wb") as file, Writer(file) as writer:
        for name, messages in topics.items():
            for index, message in enumerate(messages):
                stamp_ns = BEGIN_NS + index * STEP_NS
                message.timestamp.FromNanoseconds(stamp_ns)
                writer.write_message(topic=f"/{name}", message=message, log_time=stamp_ns + 1000 * index)
    return path


def levels(source) -> list[int]:
    return [-1 if frame.image is None else round(float(frame.image[30:, 30:].mean())) for frame in source]


def bag(folder: Path, plugin: StoragePlugin, make: Callable) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    header, time = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    with BagWriter(folder, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for index, image in enumerate(images()):
            stamp_ns = BEGIN_NS + index * STEP_NS
            stamped = header(stamp=time(*divmod(stamp_ns, 10**9)), frame_id="camera")
            for topic, message in make(store.types, stamped, image):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, message.__msgtype__, typestore=store)
                data = store.serialize_cdr(message, message.__msgtype__)
                writer.write(connections[topic], stamp_ns, data)
    return folder


def raw(types, header, image):
    rows = np.zeros((60, 84), np.uint8)  # rows are longer than the image
    rows[:, :80] = image[..., 0]
    yield (
        "/camera/image_raw",
        types["sensor_msgs/msg/Image"](header, 60, 80, "mono8", is_bigendian=0, step=84, data=rows.ravel()),
    )


def compressed(types, header, image):
    yield (
        "/camera/image/compressed",
        types["sensor_msgs/msg/CompressedImage"](header, "jpeg", np.frombuffer(jpeg(image), np.uint8)),
    )


def test_images_of_foxglove_at_the_times_of_their_messages(tmp_path: Path) -> None:
    path = mcap_file(tmp_path / "log.mcap", camera=[CompressedImage(data=jpeg(each)) for each in images()])
    source = open_source(path)
    assert (source.name, source.width_px, source.height_px, source.frame_count) == ("log", 80, 60, 6)
    assert source.fps == pytest.approx(25.0)
    assert levels(source) == [60, 80, 100, 120, 140, 160]
    assert not any(frame.is_predicted for frame in source)
    assert [frame.timestamp_ns for frame in source] == [index * STEP_NS for index in range(6)]
    assert next(iter(open_source(path, fps=10.0))).timestamp_ns == 0
    assert [frame.timestamp_ns for frame in open_source(path, fps=10.0)][1] == 100_000_000


@pytest.mark.parametrize(("name", "codec"), [("vp9", "libvpx-vp9"), ("h264", "libx264"), ("h265", "libx265")])
def test_compressed_video_frame_by_frame(tmp_path: Path, name: str, codec: str) -> None:
    messages = [CompressedVideo(format=name, data=packet) for packet in encoded_frames(codec)]
    source = open_source(mcap_file(tmp_path / "log.mcap", camera=messages))
    assert levels(source) == pytest.approx([60, 80, 100, 120, 140, 160], abs=4)
    assert all(frame.is_predicted for frame in source)


def test_raw_images_of_several_encodings(tmp_path: Path) -> None:
    image = np.zeros((60, 80, 3), np.uint8)
    image[..., 0] = 200  # blue

    def message(encoding: str, content: np.ndarray) -> RawImage:
        return RawImage(
            encoding=encoding, width=80, height=60, step=content.nbytes // 60, data=content.tobytes()
        )

    wide = np.full((60, 80), 40_000, np.uint16)
    for encoding, content, expected in (
        ("bgr8", image, [200, 0, 0]),
        ("rgb8", np.ascontiguousarray(image[..., ::-1]), [200, 0, 0]),
        ("mono16", wide, 40_000),
    ):
        path = mcap_file(tmp_path / f"{encoding}.mcap", camera=[message(encoding, content)] * 3)
        frame = next(iter(open_source(path)))
        assert frame.image[30, 40].tolist() == expected


@pytest.mark.parametrize(
    ("make", "plugin"),
    [
        (raw, StoragePlugin.MCAP),
        (compressed, StoragePlugin.SQLITE3),
        pytest.param(raw, StoragePlugin.SQLITE3, marks=pytest.mark.slow),
        pytest.param(compressed, StoragePlugin.MCAP, marks=pytest.mark.slow),
    ],
)
def test_bags_of_ros(tmp_path: Path, plugin: StoragePlugin, make: Callable) -> None:
    folder = bag(tmp_path / "press", plugin, make)
    source = open_source(folder)
    assert (source.name, source.frame_count) == ("press", 6)
    assert levels(source) == pytest.approx([60, 80, 100, 120, 140, 160], abs=1)
    assert [frame.timestamp_ns for frame in source] == [index * STEP_NS for index in range(6)]
    if plugin is StoragePlugin.MCAP:
        assert levels(open_source(next(folder.glob("*.mcap")))) == levels(source)


@pytest.mark.parametrize(("is_bigendian", "order"), [(0, "<u2"), (1, ">u2")])
def test_images_of_ros_with_two_bytes_in_either_order(tmp_path: Path, is_bigendian: int, order: str) -> None:
    def make(types, header, image):
        levels = np.full((60, 80), 3000, order)
        content = np.frombuffer(levels.tobytes(), np.uint8)
        yield (
            "/camera/image_raw",
            types["sensor_msgs/msg/Image"](header, 60, 80, "mono16", is_bigendian, 160, content),
        )

    frame = next(iter(open_source(bag(tmp_path / "press", StoragePlugin.MCAP, make))))
    assert frame.image.dtype == np.uint16
    assert frame.image[30, 40] == 3000


def test_of_several_topics_one_is_chosen_by_name(tmp_path: Path) -> None:
    path = mcap_file(
        tmp_path / "two.mcap",
        left=[CompressedImage(data=jpeg(each)) for each in images()],
        right=[CompressedImage(data=jpeg(255 - each)) for each in images()],
    )
    with pytest.raises(
        SourceError, match=r"images on several topics \(/left, /right\): append one .*two.mcap#/left"
    ):
        open_source(path)
    assert levels(open_source(f"{path}#/right"))[0] == 195
    with pytest.raises(SourceError, match="no images on the topic /up: choose one of /left, /right"):
        open_source(f"{path}#/up")
    assert result_name(f"{path}#/right") == "two"


def test_damaged_images_are_frames_without_an_image_and_other_logs_are_refused(tmp_path: Path) -> None:
    messages = [CompressedImage(data=jpeg(each)) for each in images()]
    messages[2] = CompressedImage(data=b"\xff\xd8 nothing")
    messages[3] = CompressedImage(data=jpeg(picture()))  # of another size
    path = mcap_file(tmp_path / "log.mcap", camera=messages)
    assert levels(open_source(path)) == [60, 80, -1, -1, 140, 160]
    assert not is_playback(str(path), None)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(SourceError, match=r"damaged|no summary"):
        open_source(path)
    other = RawImage(encoding="yuyv", width=80, height=60, step=160, data=bytes(160 * 60))
    with pytest.raises(SourceError, match=r"can be decoded: record or convert them to JPEG, PNG, .*bgr8"):
        open_source(mcap_file(tmp_path / "yuyv.mcap", camera=[other]))
    empty = mcap_file(tmp_path / "empty.mcap", log=[])
    with pytest.raises(SourceError, match=r"has no images: topics with foxglove\.CompressedVideo"):
        open_source(empty)
