"""A stock node of ROS 2 Jazzy (rclpy from wheels, in a venv of its own) receives the simulated sensor."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from manytouch.recording.reader import Recording
from manytouch.values import Reading
from peer_python import python_with

pytestmark = pytest.mark.slow

PEERS = Path(__file__).parents[1] / "peers"
PAGE = Path(__file__).parents[2] / "docs" / "ros2.md"
MESSAGES = ("geometry", "sensor", "visualization", "diagnostic")  # there is no package tf2-msgs
PACKAGES = (*("rclpy", "rmw-fastrtps-cpp"), *(f"{name}-msgs" for name in MESSAGES))
ENVIRONMENT = {
    **os.environ,
    "ROS_DOMAIN_ID": "88",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "CYCLONEDDS_URI": (PEERS / "loopback.xml").as_uri(),
}
SESSION = """
import json, sys, threading
from pathlib import Path
import manytouch
from manytouch.sources.simulated import simulated_source

is_over = threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), is_over.set()), daemon=True).start()
source = simulated_source().lasting(300.0)
with manytouch.stream(source, to=["ros2://skin"], record=Path(sys.argv[1])) as readings:
    print("ready", flush=True)
    for reading in readings:
        if is_over.is_set():
            break
    notes, (output,) = readings.health.notes, readings.health.outputs
print(json.dumps({"notes": notes, "sent": output.sent, "dropped": output.dropped, "problem": output.problem}))
"""
STAMP_NS = 5_000_000  # recording and output determine the begin of the session by themselves


@dataclass
class Session:
    """A running session."""

    running: "subprocess.Popen[str]"
    path: Path

    def end(self) -> dict:
        """End it; its notes and what it has sent."""
        output, _ = self.running.communicate("", timeout=60)
        return json.loads(output.splitlines()[-1])


@pytest.fixture(scope="module")
def ros_python(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A Python with rclpy: that of MANYTOUCH_ROS_PYTHON, else of a venv that is made here."""
    packages = [*(f"ros-jazzy-{name}" for name in PACKAGES), "numpy"]
    return python_with(packages, "MANYTOUCH_ROS_PYTHON", tmp_path_factory.mktemp("ros"))


@pytest.fixture
def session(tmp_path: Path) -> Iterator[Session]:
    path = tmp_path / "press.mcap"
    running = subprocess.Popen(
        [sys.executable, "-c", SESSION, str(path)],
        env=ENVIRONMENT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert running.stdout is not None
    assert running.stdout.readline() == "ready\n"
    yield Session(running=running, path=path)
    running.kill()
    running.communicate()


def listener(python: str, *words: str) -> "subprocess.Popen[str]":
    command = [python, str(PEERS / "rclpy_listener.py"), "skin", *words]
    return subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)


def heard(python: str, *words: str) -> dict[str, list[dict]]:
    """Messages by topic."""
    node = listener(python, *words)
    output, _ = node.communicate(timeout=120)
    assert node.returncode == 0
    found: dict[str, list[dict]] = {}
    for message in map(json.loads, output.splitlines()):
        found.setdefault(message["topic"], []).append(message)
    return found


def test_a_node_receives_what_is_recorded_after_another_one_was_killed(ros_python, session) -> None:
    killed = listener(ros_python, "200")
    assert killed.stdout is not None
    while '"wrench"' not in killed.stdout.readline():
        pass
    killed.kill()
    killed.communicate()
    found = heard(ros_python, "12")
    heard(ros_python, "6", "tare")
    ended = session.end()
    assert any(note.startswith("tared") for note in ended["notes"])
    assert ended["problem"] is None
    assert ended["dropped"] < 0.1 * ended["sent"]  # none, unless the machine is busy
    assert min(message["force"][2] for message in found["wrench"]) < -0.1  # the fingers press
    assert len(found["wrench"]) > 100
    recording = Recording(session.path)
    assert compared(recording, found["wrench"], require_wrench) > 100
    assert compared(recording, found["contacts"], require_contacts) > 100
    assert compared(recording, found["surface"], require_surface) > 10
    assert any(message["start"] == "ffd8ff" for message in found["image"])
    camera = recording.sensor.camera
    assert found["camera_info"][0]["size"] == [camera.width_px, camera.height_px]
    assert found["camera_info"][0]["k"][0] == camera.fx_px
    assert any(message["actions"] == [3, 0] for message in found["contact_markers"])
    assert found["diagnostics"][-1]["values"]["markers"] == "600"
    assert found["diagnostics"][-1]["values"]["dropped by ros2://skin"].isdecimal()


@pytest.mark.skipif(not PAGE.is_file(), reason="the pages come with the repository, not with the wheel")
def test_the_node_of_the_page_prints_the_force(ros_python, session, tmp_path: Path) -> None:
    (text,) = re.findall(r"^```py\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    script = tmp_path / "listen.py"
    script.write_text(text)
    node = subprocess.Popen([ros_python, str(script)], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
    assert node.stdout is not None
    line = r"contacts: [1-9], strongest #\d+: normal force [1-9]\d*\.\d\d \+- \d+\.\d\d N\n"
    pressed = next((each for each in node.stdout if re.fullmatch(line, each)), None)
    node.kill()
    node.communicate()
    assert pressed is not None


def compared(recording: Recording, messages: list[dict], require) -> int:
    """How many messages agree with the recorded readings of their times."""
    begin_ns = int(recording.about["started_unix_ns"])
    stamps_ns = begin_ns + np.array([place.timestamp_ns for place in recording.frames])
    count = 0
    for message in messages:
        place = int(np.abs(stamps_ns - message["stamp_ns"]).argmin())
        assert abs(int(stamps_ns[place]) - message["stamp_ns"]) < STAMP_NS
        reading = recording.reading(recording.frame(place))
        assert reading is not None
        require(message, reading)
        count += 1
    return count


def require_wrench(message: dict, reading: Reading) -> None:
    force_N = sum((contact.force_N for contact in reading.contacts.touching), np.zeros(3))
    assert message["frame"] == "skin_sheet"
    assert message["force"] == pytest.approx(force_N, rel=1e-4, abs=1e-6)


def require_contacts(message: dict, reading: Reading) -> None:
    assert len(message["points"]) == len(reading.contacts.contacts)
    for point, contact in zip(message["points"], reading.contacts.contacts, strict=True):
        values = dict(zip(message["names"], point, strict=True))
        assert values["id"] == contact.id
        assert [values["x"], values["y"]] == pytest.approx(contact.centre_mm * 1e-3, rel=1e-4, abs=1e-7)
        assert values["depth"] == pytest.approx(contact.depth_mm * 1e-3, rel=1e-4)
        assert values["fz"] == pytest.approx(contact.force_N[2], rel=1e-4)
        std_N = contact.std("normal_force")
        assert values["normal_force_std"] == pytest.approx(
            std_N, rel=2e-2, nan_ok=True
        )  # stored with 12 bits


def require_surface(message: dict, reading: Reading) -> None:
    points = np.array(message["points"])
    assert points[:, :3] == pytest.approx(reading.surface.position_mm * 1e-3, abs=1e-6, nan_ok=True)
