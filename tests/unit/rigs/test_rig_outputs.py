"""Outputs of the sensors of a rig."""

import re
from pathlib import Path

import numpy as np
import pytest

from manytouch.errors import SourceError
from manytouch.rigs.rig_file import load_rig
from manytouch.rigs.rig_outputs import ros_name, with_outputs
from manytouch.sinks.publishers.address import parse_address
from manytouch.sinks.publishers.ros2 import mount_of

RIG = """schema = 1
name = "hand"
[[sensors]]
name = "index-tip"
source = "sim:one"
to = ["osc://127.0.0.1:9000"]
[sensors.pose]
rotation_vector = [0.0, 0.0, 1.5]
translation_mm = [40.0, 0.0, -2.5]
[[sensors]]
name = "thumb"
source = "sim:one"
to = ["osc://127.0.0.1:9001", "ros2://own?domain=7"]
"""


def test_each_sensor_has_topics_of_its_own_with_its_pose(tmp_path: Path) -> None:
    (tmp_path / "hand.toml").write_text(RIG)
    index, thumb = with_outputs(load_rig(tmp_path / "hand.toml"), ["ros2://hand?images=5"]).sensors
    assert index.to[0] == "osc://127.0.0.1:9000"
    ros = parse_address(index.to[1])
    assert (ros.host, ros.path, ros.options["images"]) == ("hand", "index_tip", "5")
    mount = mount_of(ros)
    assert mount is not None
    assert mount.parent == "hand"
    assert mount.translation_mm == (40.0, 0.0, -2.5)
    np.testing.assert_allclose(mount.rotation_vector, (0.0, 0.0, 1.5), atol=1e-8)
    own = parse_address(thumb.to[1])
    assert (own.host, own.options["domain"], own.options["parent"]) == ("own", "7", "hand")


def test_what_receivers_could_not_distinguish_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "hand.toml"
    path.write_text(RIG)
    with pytest.raises(
        SourceError, match=r"address of its own in the rig file, such as to = \['osc://h:1'\]"
    ):
        with_outputs(load_rig(path), ["osc://h:1"])
    path.write_text(RIG.replace("9001", "9000"))
    with pytest.raises(SourceError, match=r"several sensors send to osc://127\.0\.0\.1:9000"):
        with_outputs(load_rig(path), [])


def test_names_are_those_that_ros_allows() -> None:
    assert [ros_name(text) for text in ("index-tip", "2nd", "thumb")] == ["index_tip", "_2nd", "thumb"]


def test_the_rig_to_try_of_the_documentation_is_one(tmp_path: Path) -> None:
    page = Path(__file__).parents[3] / "docs" / "rigs.md"
    if not page.exists():
        pytest.skip("the pages come with the repository, not with the wheel")
    (text,) = re.findall(r"## To try\n.*?```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "try.toml").write_text(text)
    rig = with_outputs(load_rig(tmp_path / "try.toml"), ["ros2://hand"])
    assert [(sensor.name, sensor.source) for sensor in rig.sensors] == [("index", "sim:"), ("thumb", "sim:")]
