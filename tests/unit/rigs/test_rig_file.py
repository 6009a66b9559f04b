"""The rig file: what it states, and its mistakes."""

import re
from pathlib import Path

import pytest

from manytouch.errors import SourceError
from manytouch.rigs.rig_file import camera_with_serial, load_rig

GOOD = """
schema = 1
name = "hand"

[[sensors]]
name = "index"
source = "press.mp4"
sensor = "gelsight-mini"

[[sensors]]
name = "thumb"
source = "sim:one"
fps = 10.0
size_px = [640, 480]
[sensors.pose]
rotation_vector = [0.0, 0.0, 1.5707963267948966]
translation_mm = [10.0, 20.0, 30.0]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def test_paths_are_relative_to_the_rig_file_where_they_exist(tmp_path: Path) -> None:
    (tmp_path / "press.mp4").touch()
    index, thumb = load_rig(written(tmp_path, GOOD)).sensors
    assert (index.source, index.sensor) == (str(tmp_path / "press.mp4"), "gelsight-mini")
    assert (thumb.source, thumb.fps, thumb.size_px) == ("sim:one", 10.0, (640, 480))


def test_all_mistakes_are_listed_at_once(tmp_path: Path) -> None:
    text = """
schema = 2
name = "my hand"
[[sensors]]
name = "a"
source = "0"
colour = "red"
[[sensors]]
name = "b"
[sensors.pose]
translation_mm = [1.0]
"""
    with pytest.raises(SourceError) as caught:
        load_rig(written(tmp_path, text))
    for words in ("schema", "name = 'my hand'", "plugged in again", "unknown key", "translation_mm"):
        assert words in str(caught.value), words


def test_mistakes_between_keys_are_listed_with_those_of_single_keys(tmp_path: Path) -> None:
    text = """
schema = 1
name = "hand"
[[sensors]]
name = "A"
source = "sim:one"
colour = "red"
[[sensors]]
name = "a"
fps = -1.0
"""
    with pytest.raises(SourceError) as caught:
        load_rig(written(tmp_path, text))
    for words in (
        "unknown key",
        "several sensors are named a",
        "sensors.1.serial: .*either source or serial",
        "fps",
    ):
        assert re.search(words, str(caught.value)), words


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('name = "thumb"', 'name = "Index"'), "several sensors are named index"),
        (('source = "sim:one"', 'source = "sim:one"\nserial = "7"'), "either source or serial"),
        (('source = "sim:one"', 'source = "/dev/video2"'), "plugged in again"),
    ],
)
def test_a_rig_that_cannot_be_meant_is_refused(tmp_path: Path, change: tuple[str, str], words: str) -> None:
    with pytest.raises(SourceError, match=words):
        load_rig(written(tmp_path, GOOD.replace(*change)))
    with pytest.raises(SourceError, match="does not exist"):
        load_rig(tmp_path / "none.toml")
    with pytest.raises(SourceError, match="schema is missing: give 1; name is missing"):
        load_rig(written(tmp_path, ""))


def test_a_camera_is_found_by_its_serial_number(tmp_path: Path) -> None:
    for name in ("usb-Maker_Cam_A1-video-index0", "usb-Maker_Cam_A1-video-index1", "usb-Cam_B2-video-index0"):
        (tmp_path / name).touch()
    assert camera_with_serial("A1", tmp_path) == str(tmp_path / "usb-Maker_Cam_A1-video-index0")
    with pytest.raises(SourceError, match="0 cameras have the serial number 'A'"):
        camera_with_serial("A", tmp_path)


@pytest.mark.parametrize(
    ("text", "instead"),
    [
        ('schema = 1\nname = "a sheet"\n[camera]\nmodel = "pinhole"\n', "sensor file.*run SOURCE --sensor"),
        ('schema = 1\nname = "press"\nseconds = 3.0\n[[bodies]]\nkind = "ball"\n', "scene file.*run sim:"),
    ],
)
def test_another_kind_of_file_is_refused_with_the_command_for_it(
    tmp_path: Path, text: str, instead: str
) -> None:
    with pytest.raises(SourceError, match=instead):
        load_rig(written(tmp_path, text))
