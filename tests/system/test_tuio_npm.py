"""TUIO 1.1 and 2.0 as the npm package tuio-client receives them."""

import json
import shutil
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

pytestmark = pytest.mark.slow

CLIENT = Path(__file__).parents[1] / "peers" / "tuio_client.mjs"
PACKAGES = ("osc@2.4.5", "tuio-client@0.1.0")


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed")
    folder = tmp_path_factory.mktemp("npm")
    (folder / "package.json").write_text("{}")
    command = ["npm", "install", "--no-audit", "--omit=optional", "--ignore-scripts", *PACKAGES]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"the npm packages cannot be installed: {done.stderr.strip()[-200:]}")
    return folder


@pytest.mark.parametrize(("version", "port"), [("1", 43341), ("2", 43342)])
def test_the_client_sees_the_true_contacts(packages: Path, version: str, port: int) -> None:
    source = simulated_source(fps=30.0)
    sensor = source.capabilities.sensor
    scale = TouchScale(sensor)
    encode: Callable = Tuio11(scale) if version == "1" else Tuio20(scale, (1280, 720))
    command = ["node", str(CLIENT), str(packages), version, str(port), "8"]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert client.stdout is not None
    assert json.loads(client.stdout.readline())["event"] == "ready"
    publisher = OscPublisher(parse_address(f"tuio://127.0.0.1:{port}"), encode)
    sent: dict[int, tuple[float, ...]] = {}
    for number in range(60):
        reading = _true_reading(source, number)
        publisher.publish(reading)
        for touch in TouchScale(sensor)(reading):
            sent[touch.id] = (touch.x, touch.y, touch.pressure)
    publisher.close()
    output, _ = client.communicate(timeout=30)
    events = [json.loads(line) for line in output.splitlines()]
    last = {event["id"]: event["numbers"] for event in events if event["event"] in ("add", "update")}
    assert len(sent) > 0
    assert set(last) == set(sent)
    for number, values in sent.items():
        count = 2 if version == "1" else 3
        assert last[number][:count] == pytest.approx(values[:count], abs=1e-5)


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
