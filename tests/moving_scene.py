"""Few dots on a transparent skin through a fisheye lens, before a scene that moves; drawn for the tests."""

import cv2
import numpy as np

from manytouch.values import Frame

WIDTH_PX, HEIGHT_PX = 320, 240
ROWS, COLUMNS = 4, 6
FOCAL_PX, PITCH_RAD = 115.0, 0.6
CENTRE_PX = np.array([160.0, 118.0])


def dots_px() -> np.ndarray:
    """(24, 2) centres of an even lattice of directions through an equidistant fisheye lens."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS), COLUMNS)
    offset = np.column_stack([column - (COLUMNS - 1) / 2, row - (ROWS - 1) / 2]) * PITCH_RAD
    length = np.linalg.norm(offset, axis=1, keepdims=True)
    jitter = np.random.default_rng(1).normal(0.0, 1.2, offset.shape)
    return CENTRE_PX + FOCAL_PX * offset / length * np.arctan(length) + jitter


DOTS_PX = dots_px()
RADIUS_PX = 4.5 - 0.012 * np.linalg.norm(DOTS_PX - CENTRE_PX, axis=1)


def scene(frame: int) -> np.ndarray:
    """Blurred boards and dark things in front of a wall; half of them move."""
    random = np.random.default_rng(7)
    image = np.full((HEIGHT_PX, WIDTH_PX), 150.0, dtype=np.float32)
    for thing in range(30):
        x, y = random.uniform([0, 0], [WIDTH_PX, HEIGHT_PX])
        size, grey, turn = random.uniform(20, 70, 2), random.uniform(40, 250), random.uniform(0, 180)
        way = (thing % 2) * 0.8 * frame
        place = (float((x + way) % WIDTH_PX), float((y + 0.4 * way) % HEIGHT_PX))
        box = cv2.boxPoints((place, (float(size[0]), float(size[1])), float(turn)))
        cv2.fillPoly(image, [box.astype(np.int32)], grey)
    return cv2.GaussianBlur(image, (0, 0), 2.5)


def picture(frame: int, *, has_dots: bool = True, things: int = 0) -> Frame:
    """A frame; `things` like dots are in the scene, and move from frame 60 on."""
    image = scene(frame)
    moved = max(frame - 60, 0)
    for number, (x, y) in enumerate(np.random.default_rng(5).uniform([15, 15], [305, 225], (things, 2))):
        place = (x + 3.1 * moved * (1 + number % 3)) % WIDTH_PX, (y + 1.7 * moved) % HEIGHT_PX
        cv2.circle(image, (int(place[0]), int(place[1])), 4, 40.0, -1, cv2.LINE_AA)
    if has_dots:
        for (x, y), radius in zip(DOTS_PX, RADIUS_PX, strict=True):
            cv2.circle(image, (round(16 * x), round(16 * y)), round(16 * radius), 25.0, -1, cv2.LINE_AA, 4)
    for x, y, length in ((40, 60, 9), (215, 180, 14)):  # glints
        cv2.line(image, (x, y), (x + 3, y + length), 255.0, 2)
    y, x = np.mgrid[:HEIGHT_PX, :WIDTH_PX]
    image *= np.clip(1.55 - np.hypot(x - 160, y - 120) / 240.0, 0.25, 1.0)  # dark corners
    image = cv2.GaussianBlur(image, (0, 0), 0.7)
    image += np.random.default_rng(frame).normal(0.0, 1.5, image.shape)
    whole = cv2.cvtColor(np.clip(image, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    return Frame(index=frame, timestamp_ns=frame * 40_000_000, camera="skin", image=whole)
