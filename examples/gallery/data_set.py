"""A data set: several recordings, processed in one batch, and all their contacts in one table.

`manytouch batch "day1/*.mp4" --out results` does the same; only what is missing or changed is computed.
`manytouch export --lerobot` writes recordings for learning.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np
import pyarrow.parquet as pq

from manytouch.cli import main as command

SCENE = """
schema = 1
name = "press"
seconds = 1.2
fps = 10.0
sensor = "demo"
width_px = 640
mechanics = "shell"
[light]
read_noise = 1.5
[[bodies]]
shape = {{ kind = "sphere", radius_mm = {radius_mm} }}
motions = [{{ kind = "press", at_mm = [0, 0], depth_mm = 3.0, start_s = 0.3, end_s = 1.2, ramp_s = 0.4 }}]
"""
RADII_MM = (3.0, 6.0, 12.0)


def main(picture: str = "data_set.png") -> float:
    """Draw force over depth for balls of three sizes; return the number of rows of the table."""
    with TemporaryDirectory() as text:
        folder = Path(text)
        for radius_mm in RADII_MM:
            (folder / f"ball-{radius_mm:g}.toml").write_text(
                SCENE.format(radius_mm=radius_mm), encoding="utf-8"
            )
            scene = str(folder / f"ball-{radius_mm:g}.toml")
            command(["simulate", scene, "--out", str(folder / f"ball-{radius_mm:g}")])
        inputs = [str(folder / f"ball-{radius_mm:g}" / "frames") for radius_mm in RADII_MM]
        sensor = str(folder / f"ball-{RADII_MM[0]:g}" / "sensor.toml")
        command(["batch", *inputs, "--out", str(folder / "out"), "--sensor", sensor, "--workers", "1"])
        table = pq.read_table(folder / "out" / "contacts.parquet").to_pydict()
    name, depth_mm, force_N = (np.array(table[key]) for key in ("name", "depth_mm", "normal_force_N"))
    figure, axes = plt.subplots(figsize=(7, 4.5))
    for recording, radius_mm in zip(sorted(set(name)), RADII_MM, strict=True):
        rows = name == recording
        order = np.argsort(depth_mm[rows])
        axes.plot(depth_mm[rows][order], force_N[rows][order], "o-", label=f"ball of {radius_mm:g} mm radius")
    axes.set(xlabel="depth (mm)", ylabel="normal force (N)", title="contacts.parquet of a batch")
    axes.legend()
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    return float(len(name))


if __name__ == "__main__":
    main(*sys.argv[1:])
