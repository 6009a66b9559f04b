"""`manytouch calibrate` creates the folder of the file that it writes."""

from pathlib import Path

from manytouch import load_sensor, save_sensor
from manytouch.cli import main
from manytouch.simulation.demo_sensor import demo_sensor


def test_the_folder_of_the_sensor_file_is_created(tmp_path: Path) -> None:
    camera, out = tmp_path / "camera.toml", tmp_path / "new" / "folder" / "sensor.toml"
    save_sensor(demo_sensor(1280), camera)
    words = ["--sensor", str(camera), "--pitch-mm", "4", "--sheet-mm", "120,80", "--thickness-mm", "3"]
    assert main(["calibrate", "rest", "sim:one", *words, "--out", str(out)]) == 0
    assert load_sensor(out).layout is not None
