"""The live server as the npm package of its protocol sees it, with which Lichtblick connects."""

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from foxglove_reader import bytes_of, foxglove_packages, points_of, started_reader
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.foxglove_live import FoxglovePublisher

pytestmark = pytest.mark.slow

TOPICS = {"/camera", "/surface", "/mesh", "/reading", "/calibration", "/transform"}


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return foxglove_packages(tmp_path_factory.mktemp("npm"))


@contextmanager
def publishing(publisher: FoxglovePublisher, make) -> Iterator[None]:
    """Publishes 50 readings per second, with numbers that rise, in a thread."""
    is_over = threading.Event()

    def run() -> None:
        index = 0
        while not is_over.wait(0.02):
            publisher.publish(make(index))
            index += 1

    thread = threading.Thread(target=run)
    thread.start()
    yield
    is_over.set()
    thread.join()


def test_a_client_receives_all_topics_and_another_one_after_it_was_killed(
    packages: Path, session, sensor, reading_of, contact_of
) -> None:
    def make(index: int):
        reading = reading_of(index, (contact_of(7),), depth_mm=1.5)
        return replace(reading, surface=replace(reading.surface, layout=sensor.layout))

    publisher = FoxglovePublisher(parse_address("foxglove://127.0.0.1:0"), session)
    last_index = -1
    with publishing(publisher, make):
        for _ in range(2):
            found: dict[str, dict] = {}
            client = started_reader(packages, "live", f"ws://127.0.0.1:{publisher.port}", "60")
            assert client.stdout is not None
            while set(found) != TOPICS:
                line = json.loads(client.stdout.readline())
                found.setdefault(line["topic"], line["message"])
            client.kill()
            client.communicate()
            assert found["/reading"]["frame"] > last_index
            last_index = found["/reading"]["frame"]
            assert found["/reading"]["contacts"][0]["contact"] == 7
            assert points_of(found["/surface"]["data"], 4)[0, 3] == pytest.approx(1.5, abs=1e-2)
            assert bytes_of(found["/camera"]["data"])[:3] == b"\xff\xd8\xff"
            (shape,) = found["/mesh"]["entities"][0]["triangles"]
            assert len(shape["points"]) == 61 * 41
            assert min(point.get("z", 0.0) for point in shape["points"]) == pytest.approx(-1.5, abs=1e-2)
    publisher.close()
