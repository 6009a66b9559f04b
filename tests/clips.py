"""Small recordings of a dotted sheet, drawn for the tests; wider than high, fewer rows than columns."""

import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import cv2
import numpy as np

WIDTH_PX, HEIGHT_PX = 320, 240
ROWS, COLUMNS = 6, 9
PITCH_PX = (32.0, 34.0)
REACH_PX = 45.0


def picture(
    press: float = 0.0, *, seed: int = 0, scale: float = 1.0, shape: tuple[int, int] = (ROWS, COLUMNS)
) -> np.ndarray:
    """Dark dots on a light ground; a press pushes them away from a place right of the middle.

    Args:
        press: the largest displacement, px at scale 1.
        seed: of the noise.
        scale: of the whole picture, which has WIDTH_PX x HEIGHT_PX at 1 and with the usual shape.
        shape: rows and columns.
    """
    rows, columns = shape
    width = WIDTH_PX + (columns - COLUMNS) * PITCH_PX[0]
    height = HEIGHT_PX + (rows - ROWS) * PITCH_PX[1]
    row, column = np.divmod(np.arange(rows * columns), columns)
    rest = np.column_stack([(column - (columns - 1) / 2) * PITCH_PX[0], (row - (rows - 1) / 2) * PITCH_PX[1]])
    away = rest - [40.0, -20.0]
    near = np.exp(-np.sum(away**2, axis=1) / (2 * REACH_PX**2))[:, None]
    place = (rest + press * near * away / (np.exp(-0.5) * REACH_PX) + [width / 2, height / 2]) * scale
    image = np.full((round(height * scale), round(width * scale)), 190, np.uint8)
    for x, y in place:
        cv2.circle(image, (round(16 * x), round(16 * y)), round(16 * 7 * scale), 50, -1, cv2.LINE_AA, 4)
    image = cv2.GaussianBlur(image, (5, 5), 1.0)
    noise = np.random.default_rng(seed).normal(0.0, 1.5, image.shape)
    return cv2.cvtColor(np.clip(image + noise, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def press_of(frame: int) -> float:
    """Untouched for 20 frames, pressed for 20, untouched again."""
    return 9.0 * float(np.clip(min(frame - 20, 40 - frame) / 5.0, 0.0, 1.0))


def write_video(path: Path, pictures: Iterable[np.ndarray], fps: float = 25.0) -> Path:
    """An MPEG-4 or Motion JPEG video, by the suffix .mp4 or .avi."""
    code = cv2.VideoWriter.fourcc(*("mp4v" if path.suffix == ".mp4" else "MJPG"))
    writer = None
    for image in pictures:
        if writer is None:
            writer = cv2.VideoWriter(str(path), code, fps, (image.shape[1], image.shape[0]))
        writer.write(image)
    assert writer is not None
    writer.release()
    return path


def pressed_video(path: Path, frames: int = 60) -> Path:
    """A recording that is untouched, pressed once, and untouched again, over and over."""
    path.write_bytes(_pressed_video(path.suffix, frames))
    return path


@cache
def _pressed_video(suffix: str, frames: int) -> bytes:
    """The file, which is made once."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"press{suffix}"
        write_video(path, (picture(press_of(index % 60), seed=index) for index in range(frames)))
        return path.read_bytes()
