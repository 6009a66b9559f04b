"""The official loader of LeRobot 0.4.4, in a venv of its own, opens an exported recording."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from manytouch.sinks.exports.registry import export
from peer_python import python_with

pytestmark = pytest.mark.slow

LOADER = """
import json, sys
from lerobot.datasets.lerobot_dataset import LeRobotDataset
loaded = LeRobotDataset("local/manytouch", root=sys.argv[1], video_backend="pyav")
items = [loaded[place] for place in (0, len(loaded) - 1)]
print(json.dumps({
    "frames": len(loaded),
    "episodes": loaded.num_episodes,
    "shapes": {name: list(value.shape) for name, value in items[0].items() if hasattr(value, "shape")},
    "levels": [float(item["observation.images.tactile"].mean()) for item in items],
    "force_z_N": [float(item["observation.tactile.wrench"][2]) for item in items],
    "tasks": [item["task"] for item in items],
}))
"""


@pytest.fixture(scope="module")
def lerobot_python(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A Python with lerobot: that of MANYTOUCH_LEROBOT_PYTHON, else of a venv that is made here."""
    return python_with(["lerobot==0.4.4"], "MANYTOUCH_LEROBOT_PYTHON", tmp_path_factory.mktemp("lerobot"))


def test_the_official_loader_opens_a_recording(lerobot_python: str, tmp_path: Path) -> None:
    recording = tmp_path / "press.mcap"
    command = ["run", "sim:", "--no-view", "--record", str(recording)]
    running = subprocess.Popen([sys.executable, "-m", "manytouch", *command], stdout=subprocess.DEVNULL)
    try:
        running.wait(timeout=20)
    except subprocess.TimeoutExpired:
        running.send_signal(2)
        running.wait(timeout=60)
    (folder,) = export([recording], "lerobot", tmp_path / "set")
    done = subprocess.run(
        [lerobot_python, "-c", LOADER, str(folder)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "HF_HUB_OFFLINE": "1"},
    )
    found = json.loads(done.stdout.splitlines()[-1])
    info = json.loads((folder / "meta" / "info.json").read_text())
    assert (found["frames"], found["episodes"]) == (info["total_frames"], 1)
    assert found["shapes"]["observation.tactile.displacement"] == [600, 3]
    assert found["shapes"]["observation.images.tactile"][0] == 3
    assert min(found["levels"]) > 0.05
    assert min(found["force_z_N"]) <= 0.0
    assert found["tasks"] == ["touch", "touch"]
