"""Bags and recordings as the npm packages read them with which Foxglove and Lichtblick open files."""

import json
from pathlib import Path

import numpy as np
import pytest

from foxglove_reader import bytes_of, foxglove_packages, points_of, started_reader
from manytouch.sinks.exports.registry import export

pytestmark = pytest.mark.slow

FRAMES = 5
SURFACE_COLUMNS = 5


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return foxglove_packages(tmp_path_factory.mktemp("npm"))


def messages_of(packages: Path, file: Path) -> dict[str, list[dict]]:
    """Decoded messages by topic."""
    reader = started_reader(packages, "file", str(file))
    output, _ = reader.communicate(timeout=60)
    assert reader.returncode == 0
    found: dict[str, list[dict]] = {}
    for line in map(json.loads, output.splitlines()):
        found.setdefault(line["topic"], []).append(line["message"])
    return found


def test_a_bag_has_the_recorded_values(packages: Path, record, tmp_path: Path) -> None:
    (bag,) = export([record(tmp_path / "press.mcap")], "ros2bag", tmp_path / "bags")
    found = messages_of(packages, bag / "press.mcap")
    counts = {topic: len(each) for topic, each in found.items()}
    topics = ("image/compressed", "camera_info", "wrench", "contacts", "surface", "contact_markers")
    assert counts == {"/tf_static": 1} | {f"/manytouch/{topic}": FRAMES for topic in topics}
    forces = [each["wrench"]["force"] for each in found["/manytouch/wrench"]]
    assert forces == [{"x": 0.125, "y": 0.25, "z": -1.0 - index} for index in range(FRAMES)]
    points = points_of(found["/manytouch/surface"][2]["data"], SURFACE_COLUMNS)
    assert points[0] == pytest.approx([-12.4e-3, -6.2e-3, -2.5e-3, 2.5e-3, np.nan], nan_ok=True, rel=1e-3)
    contacts = found["/manytouch/contacts"][4]
    assert [field["name"] for field in contacts["fields"]][:3] == ["id", "phase", "x"]
    assert contacts["width"] == 1
    arrows = found["/manytouch/contact_markers"][4]["markers"]
    assert [marker["action"] for marker in arrows] == [3, 0]
    assert found["/manytouch/camera_info"][0]["k"][0] == 400.0
    assert bytes_of(found["/manytouch/image/compressed"][0]["data"])[:4] == b"\x89PNG"
    (transform,) = found["/tf_static"][0]["transforms"]
    assert transform["transform"]["translation"]["z"] == pytest.approx(0.05)


def test_a_recording_has_its_image_cloud_and_numbers(packages: Path, record, tmp_path: Path) -> None:
    found = messages_of(packages, record(tmp_path / "press.mcap"))
    assert bytes_of(found["/camera"][0]["data"])[:4] == b"\x89PNG"
    points = points_of(found["/surface"][3]["data"], 4)
    assert points[0, 3] == pytest.approx(3.5, abs=1e-2)
    contacts = [each["contacts"][0] for each in found["/reading"]]
    assert [each["normal_force_N"] for each in contacts] == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert found["/calibration"][0]["K"][0] == 400.0
    assert found["/transform"][0]["translation"]["z"] == pytest.approx(50.0)
