"""Calibrate a camera from views of a printed chessboard, as `manytouch calibrate camera` does.

The views are simulated through a lens that is known, so that the result can be compared. With your
camera, take 15 sharp images: tilted in different directions, near and far, in the centre and in every
corner.
"""

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt

import manytouch
from manytouch.cli import main as command

SCENE = Path(__file__).with_name("board.toml")


def main(picture: str = "calibrate.png") -> float:
    """Draw the coverage of the image and the residuals; return the relative error of the focal length."""
    true = manytouch.open_source("sim:one").sensor
    with TemporaryDirectory() as text:
        folder = Path(text)
        manytouch.save_sensor(true, folder / "sensor.toml")
        shutil.copy(SCENE, folder / "board.toml")
        command(["simulate", str(folder / "board.toml"), "--out", str(folder / "views")])
        words = ["--board", "chessboard:9x6", "--square-mm", "8", "--report", str(folder / "report")]
        images = str(folder / "views" / "frames")
        command(["calibrate", "camera", images, *words, "--out", str(folder / "camera.toml")])
        camera = manytouch.load_sensor(folder / "camera.toml").camera
        views = [plt.imread(path) for path in sorted((folder / "views" / "frames").glob("*.png"))[:12:4]]
        coverage = plt.imread(folder / "report" / "coverage.png")
    figure = plt.figure(figsize=(11, 5))
    for row, view in enumerate(views):
        axes = figure.add_subplot(3, 3, 3 * row + 1)
        axes.imshow(view, cmap="gray")
        axes.axis("off")
    axes = figure.add_subplot(1, 3, (2, 3))
    axes.imshow(coverage)
    axes.axis("off")
    axes.set_title(f"focal length {camera.fx_px:.1f} px, true {true.camera.fx_px:.1f} px")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    print(f"focal length {camera.fx_px:.1f} px, true {true.camera.fx_px:.1f} px")
    return float(abs(camera.fx_px / true.camera.fx_px - 1))


if __name__ == "__main__":
    main(*sys.argv[1:])
