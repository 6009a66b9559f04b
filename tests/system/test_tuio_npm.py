"""TUIO 1.1 and 2.0 as the npm package tuio-client receives them."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.touches import TouchScale
from manytouch.sinks.publishers.tuio import Tuio11, Tuio20
from manytouch.sinks.publishers.udp import OscPublisher
from manytouch.sources.simulated import simulated_source
from manytouch.values import Detections, Frame, Reading
from peer_node import node_packages

pytestmark = pytest.mark.slow

CLIENT = Path(__file__).parents[1] / "peers" / "tuio_client.mjs"
PACKAGES = ("osc@2.4.5", "tuio-client@0.1.0")


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return node_packages(PACKAGES, tmp_path_factory.mktemp("npm"))


@pytest.mark.parametrize(("version", "port"), [("1", 43341), ("2", 43342)])
def test_the_client_sees_the_true_contacts_also_after_another_one_was_killed(
    packages: Path, version: str, port: int
) -> None:
    source = simulated_source(fps=30.0)
    sensor = source.capabilities.sensor
    scale = TouchScale(sensor)
    encode: Callable = Tuio11(scale) if version == "1" else Tuio20(scale, (1280, 720))
    publisher = OscPublisher(parse_address(f"tuio://127.0.0.1:{port}"), encode)
    sent: dict[int, tuple[float, ...]] = {}

    def publish(numbers: range) -> None:
        for number in numbers:
            reading = _true_reading(source, number)
            publisher.publish(reading)
            sent.update({each.id: (each.x, each.y, each.pressure) for each in TouchScale(sensor)(reading)})

    first = started_client(packages, version, port)
    publish(range(50))
    assert first.stdout is not None
    assert json.loads(first.stdout.readline())["event"] == "add"
    first.kill()
    first.communicate()
    publish(range(50, 53))  # nobody listens
    sent.clear()
    second = started_client(packages, version, port)
    publish(range(53, 63))
    publisher.close()
    output, _ = second.communicate(timeout=30)
    events = [json.loads(line) for line in output.splitlines()]
    last = {event["id"]: event["numbers"] for event in events if event["event"] in ("add", "update")}
    assert len(sent) > 0
    assert set(last) == set(sent)
    for number, values in sent.items():
        count = 2 if version == "1" else 3
        assert last[number][:count] == pytest.approx(values[:count], abs=1e-5)


def started_client(packages: Path, version: str, port: int) -> "subprocess.Popen[str]":
    command = ["node", str(CLIENT), str(packages), version, str(port), "8"]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert client.stdout is not None
    assert json.loads(client.stdout.readline())["event"] == "ready"
    return client


def _true_reading(source, number: int):
    """A reading whose contacts are those of the ground truth."""

    truth = source.simulator.truth(number)
    none = np.zeros((0, 2))
    return Reading(
        frame=Frame(index=number, timestamp_ns=round(number * 1e9 / 30), camera="", image=None),
        detections=Detections(
            centre_px=none, covariance_px2=np.zeros((0, 2, 2)), area_px2=none[:, 0], contrast=none[:, 0]
        ),
        grid=truth.grid,
        surface=truth.surface,
        contacts=truth.contacts,
        milliseconds=1.0,
    )
