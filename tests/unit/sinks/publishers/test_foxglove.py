"""The live server of Foxglove, as a client sees it that speaks its protocol (foxglove.sdk.v1)."""

import json
import struct
import time
from dataclasses import replace

import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from websockets.sync.client import connect

from manytouch.errors import OutputError
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.foxglove_live import FoxglovePublisher
from manytouch.sinks.publishers.registry import open_outputs


@pytest.fixture
def publisher(session):
    one = FoxglovePublisher(parse_address("foxglove://127.0.0.1:0"), session)
    yield one
    one.close()


def received(publisher: FoxglovePublisher, reading, topics: tuple[str, ...]) -> dict[str, bytes]:
    """The first message on each topic, for a new client."""
    found: dict[str, bytes] = {}
    with connect(f"ws://127.0.0.1:{publisher.port}", subprotocols=["foxglove.sdk.v1"]) as socket:
        known: dict[int, str] = {}
        while len(known) < 6:
            message = socket.recv(timeout=5)
            if isinstance(message, str) and (decoded := json.loads(message))["op"] == "advertise":
                known |= {channel["id"]: channel["topic"] for channel in decoded["channels"]}
        wanted = [{"id": number, "channelId": number} for number, topic in known.items() if topic in topics]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        end_s = time.monotonic() + 20.0
        while len(found) < len(topics) and time.monotonic() < end_s:
            try:
                message = socket.recv(timeout=0.05)
            except TimeoutError:  # everything that was sent is read
                publisher.publish(reading)
                continue
            if isinstance(message, bytes) and message[0] == 1:
                number, _ = struct.unpack_from("<IQ", message, 1)
                found.setdefault(known[number], message[13:])
    return found


def test_a_client_receives_image_cloud_mesh_and_numbers(publisher, reading_of, contact_of, sensor) -> None:
    reading = reading_of(3, (contact_of(7),), depth_mm=1.5)
    reading = replace(reading, surface=replace(reading.surface, layout=sensor.layout))
    found = received(publisher, reading, ("/camera", "/surface", "/mesh", "/reading"))
    assert json.loads(found["/reading"])["contacts"][0]["contact"] == 7
    image = CompressedImage.FromString(found["/camera"])
    assert (image.format, image.data[:3]) == ("jpeg", b"\xff\xd8\xff")
    cloud = PointCloud.FromString(found["/surface"])
    points = np.frombuffer(cloud.data, "<f4").reshape(-1, 4)
    assert points[0, 3] == pytest.approx(1.5, abs=1e-2)
    (shape,) = SceneUpdate.FromString(found["/mesh"]).entities[0].triangles
    assert len(shape.points) == 61 * 41
    assert len(shape.indices) == 60 * 40 * 6
    mesh_mm = np.array([(point.x, point.y, point.z) for point in shape.points]).reshape(41, 61, 3)
    assert -mesh_mm[:, :, 2].min() == pytest.approx(1.5, abs=0.01)
    assert mesh_mm[0, -1] - mesh_mm[0, 0] == pytest.approx([30.0, 0.0, 0.0], abs=0.01)
    assert mesh_mm[-1, 0] - mesh_mm[0, 0] == pytest.approx([0.0, 16.0, 0.0], abs=0.01)


def test_a_client_that_comes_again_receives_what_follows(publisher, reading_of) -> None:
    for index in range(2):
        assert json.loads(received(publisher, reading_of(index), ("/reading",))["/reading"])["frame"] == index


def test_without_a_client_nothing_is_encoded(publisher, reading_of, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(reading_of(0)), "to_dict", lambda _: pytest.fail("nobody reads it"))
    publisher.publish(reading_of(0))


def test_a_port_in_use_is_one_sentence(publisher, session) -> None:
    with pytest.raises(OutputError, match=r"is not available .*: choose another port"):
        open_outputs([f"foxglove://127.0.0.1:{publisher.port}"], session)
