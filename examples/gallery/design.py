"""From requirements to a sensor: sheet, dots, camera and parts to print, as `manytouch design` chooses them.

The command also writes STL, 3MF and STEP files, true-size patterns, a bill of materials and scenes that
simulate the sensor. Needs the extra: pip install 'manytouch[parts]'.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import manytouch
from manytouch.cli import main as command


def main(picture: str = "design.png") -> float:
    """Draw layout and assembly; return the pitch, mm."""
    with TemporaryDirectory() as folder:
        words = ["--area-mm", "60,40", "--force-N", "0.2,6", "--explain", "--out", folder]
        if command(["design", *words]) != 0:
            raise SystemExit("the design failed; the line above states why")
        sensor = manytouch.load_sensor(Path(folder) / "sensor.toml")
        assembly = plt.imread(Path(folder) / "assembly.png")
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5))
    manytouch.plot_layout(sensor, left)
    pitch_mm, distance_mm = float(sensor.layout.pitch_mm[0]), sensor.camera.translation_mm[2]
    left.set_title(f"{len(sensor.layout.rest_mm)} dots every {pitch_mm:g} mm, camera at {distance_mm:.0f} mm")
    right.imshow(assembly)
    right.axis("off")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    return pitch_mm


if __name__ == "__main__":
    main(*sys.argv[1:])
