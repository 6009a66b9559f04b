"""A video of a sheet with dots becomes a table of contacts.

No settings: dots, rows, columns and rest positions are found in the first frames. The pitch of the dots
and the field of view of the camera make millimetres. Here the video is simulated; with your own, give
its path to `process`.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import matplotlib.pyplot as plt

import manytouch

SCENE = Path(__file__).with_name("press.toml")


def film(video: Path) -> None:
    """A video of the simulated sheet."""
    source = manytouch.open_source(f"sim:{SCENE}")
    writer = None
    for frame in source:
        height, width = frame.image.shape[:2]
        writer = writer or cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), 15.0, (width, height))
        writer.write(cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR) if frame.image.ndim == 2 else frame.image)
    writer.release()


def main(picture: str = "first_video.png") -> float:
    """Draw the deepest frame and the depth over time; return the distance from the true place, mm."""
    with TemporaryDirectory() as folder:
        video = Path(folder) / "press.mp4"
        film(video)
        settings = {"pitch_mm": 4.0, "hfov_deg": 63.7}
        results = manytouch.read_results(manytouch.process(video, out=Path(folder) / "out", **settings))
        readings = list(manytouch.prepare(video, **settings).readings())
    deepest = max(
        (each for each in readings if each.contacts.touching),
        key=lambda each: each.contacts.touching[0].depth_mm,
    )
    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), width_ratios=[3, 2])
    deepest.draw(left)
    manytouch.plot_contacts(results, right)
    right.set_title("depth of each contact, ± 2 standard deviations")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    x_mm, y_mm = deepest.contacts.touching[0].centre_mm
    print(f"estimate ({x_mm:.1f}, {y_mm:.1f}) mm, truth (-15, 8) mm")
    return float(abs(complex(x_mm + 15, y_mm - 8)))


if __name__ == "__main__":
    main(*sys.argv[1:])
