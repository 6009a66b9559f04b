"""The live server of Foxglove, as a client sees it that speaks its protocol (foxglove.sdk.v1)."""

import json
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from websockets.sync.client import ClientConnection, connect

from manytouch.errors import OutputError
from manytouch.sinks.publishers import foxglove_live
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.foxglove_live import FoxglovePublisher
from manytouch.sinks.publishers.registry import open_outputs
from manytouch.values import OutlineRing
from waiting import wait_until

RECEIVERS = Path(__file__).parents[3] / "peers" / "receivers.py"


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


@contextmanager
def subscribed(
    publisher: FoxglovePublisher, topics: tuple[str, ...]
) -> Iterator[tuple[ClientConnection, dict[int, str]]]:
    """A client of some topics, and their numbers."""
    address = f"ws://127.0.0.1:{publisher.port}"
    with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as client:
        known: dict[int, str] = {}
        while len(known) < 6:
            message = client.recv(timeout=5)
            if isinstance(message, str) and (decoded := json.loads(message))["op"] == "advertise":
                known |= {channel["id"]: channel["topic"] for channel in decoded["channels"]}
        wanted = [{"id": number, "channelId": number} for number, topic in known.items() if topic in topics]
        client.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
        wait_until(lambda: all(publisher.channels[topic].has_sinks() for topic in topics))
        yield client, known


def test_clouds_have_the_rate_of_the_readings_and_meshes_five_per_second(
    publisher, reading_of, sensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock_s = iter(np.arange(1000.0) / 30.0)
    monkeypatch.setattr(foxglove_live, "time", SimpleNamespace(monotonic=lambda: float(next(clock_s))))
    reading = reading_of(0, depth_mm=1.5)
    reading = replace(reading, surface=replace(reading.surface, layout=sensor.layout))
    counts = {"/surface": 0, "/mesh": 0}
    with subscribed(publisher, ("/surface", "/mesh")) as (client, known):
        for _ in range(60):  # two seconds
            publisher.publish(reading)
        while counts["/surface"] < 60:
            message = client.recv(timeout=5)
            if isinstance(message, bytes):
                counts[known[struct.unpack_from("<I", message, 1)[0]]] += 1
    assert counts["/mesh"] == 10


@pytest.mark.skipif(sys.platform == "win32", reason="it has no signal that stops")
def test_a_client_that_takes_nothing_any_more_delays_no_other_one(publisher, reading_of, contact_of) -> None:
    contact = contact_of(
        7, force_N=np.array([0.0, 0.0, -1.0]), outline=(OutlineRing(point_mm=np.zeros((100, 2))),)
    )
    command = [sys.executable, str(RECEIVERS), "foxglove", str(publisher.port)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as stuck:
        wait_until(publisher.channels["/reading"].has_sinks)
        stuck.send_signal(signal.SIGSTOP)
        for index in range(4000):  # more than sockets and the queue of the server hold
            publisher.publish(reading_of(index, (contact,)))
        last = reading_of(4000, (contact,))
        assert json.loads(received(publisher, last, ("/reading",))["/reading"])["frame"] == 4000
        stuck.kill()


def test_without_a_client_nothing_is_encoded(publisher, reading_of, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(type(reading_of(0)), "to_dict", lambda _: pytest.fail("nobody reads it"))
    publisher.publish(reading_of(0))


def test_a_port_in_use_is_one_sentence(publisher, session) -> None:
    with pytest.raises(OutputError, match=r"is not available .*: choose another port"):
        open_outputs([f"foxglove://127.0.0.1:{publisher.port}"], session)


@pytest.mark.parametrize("host", ["192.0.2.1", "no-such-host.invalid"])
def test_a_host_that_is_not_this_computer_is_one_sentence(host: str, session) -> None:
    with pytest.raises(OutputError, match=r"is not available .*: .*an address of this computer, such as"):
        open_outputs([f"foxglove://{host}:8765"], session)
