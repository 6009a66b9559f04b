"""A stock node of ROS 2 Jazzy (rclpy from wheels, in a venv of its own) receives the simulated sensor."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from peer_python import python_with

pytestmark = pytest.mark.slow

PEERS = Path(__file__).parents[1] / "peers"
PACKAGES = [f"ros-jazzy-{name}" for name in ("rclpy", "geometry-msgs", "sensor-msgs", "rmw-fastrtps-cpp")]
ENVIRONMENT = {
    **os.environ,
    "ROS_DOMAIN_ID": "88",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    "CYCLONEDDS_URI": (PEERS / "loopback.xml").as_uri(),
}


@pytest.fixture(scope="module")
def ros_python(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A Python with rclpy: that of MANYTOUCH_ROS_PYTHON, else of a venv that is made here."""
    return python_with([*PACKAGES, "numpy"], "MANYTOUCH_ROS_PYTHON", tmp_path_factory.mktemp("ros"))


@pytest.fixture
def session() -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-m", "manytouch", "run", "sim:", "--no-view", "--to", "ros2://skin"]
    running = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE, text=True)
    yield running
    running.send_signal(signal.SIGINT)
    running.communicate(timeout=60)


def heard(python: str, *words: str) -> list[dict]:
    done = subprocess.run(
        [python, str(PEERS / "rclpy_listener.py"), "skin", *words],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_a_node_receives_all_topics_also_after_another_one_was_killed(ros_python, session) -> None:
    killed = subprocess.Popen(
        [ros_python, str(PEERS / "rclpy_listener.py"), "skin", "100"],
        env=ENVIRONMENT,
        stdout=subprocess.DEVNULL,
    )
    time.sleep(10.0)
    killed.kill()
    killed.wait()
    messages = heard(ros_python, "15")
    by_topic = {
        topic: [m for m in messages if m["topic"] == topic] for topic in ("wrench", "contacts", "surface")
    }
    assert len(by_topic["wrench"]) > 50
    assert len(by_topic["surface"][0]["points"]) == 600
    wrench = {message["stamp_ns"]: message["force"][2] for message in by_topic["wrench"]}
    assert min(wrench.values()) < -0.1  # the fingers press
    with_contacts = next(message for message in by_topic["contacts"] if message["points"])
    assert len(with_contacts["points"][0]) == len(with_contacts["names"])
    assert any(message["topic"] == "image" and message["start"] == "ffd8ff" for message in messages)
    assert any(message["topic"] == "camera_info" for message in messages)
